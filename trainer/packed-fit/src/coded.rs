//! Encodes blocks with the device's quantiser and range coder.

use crate::in_parallel;
use artifact::PackedModel;
use packed::{Context, Header, LEVELS, MAGNITUDES, Magnitude, Rate, Tables};

/// Size of the buffer for a coded block, bytes; no coded block is longer.
const MAX_BYTES: usize = 2048;

/// Number of times that each magnitude was coded: `[quantiser][level][magnitude]`.
pub(crate) type Histogram = [[[u32; MAGNITUDES]; LEVELS]; 2];

/// A sequence of blocks after coding.
#[derive(Clone, Debug)]
pub(crate) struct Coded {
    /// Decoder state after each block, `[block][coefficient]`.
    pub(crate) states: Vec<i16>,
    /// Quantised residuals of all coefficients, each a magnitude with its sign,
    /// `[block][coefficient]`.
    pub(crate) magnitudes: Vec<i32>,
    /// Length of each block in bytes.
    pub(crate) bytes: Vec<usize>,
    /// Number of times that each magnitude was coded with each table of frequencies.
    pub(crate) histogram: Box<Histogram>,
}

/// Encodes sequences of coefficients `[sequence][block][coefficient]` at a rate. The first block of
/// each sequence and every `reset`-th block after it are coded without prediction.
pub(crate) fn code(
    model: &PackedModel,
    coefficients: &[Vec<i16>],
    rate: Rate,
    reset: usize,
) -> Vec<Coded> {
    let costs = model.costs();
    in_parallel::map(coefficients, |coefficients| {
        code_sequence(model, &costs, coefficients, rate, reset)
    })
}

fn code_sequence(
    model: &PackedModel,
    costs: &packed::Costs,
    coefficients: &[i16],
    rate: Rate,
    reset: usize,
) -> Coded {
    let count = model.coefficients();
    let tables = Tables { starts: &model.starts, costs };
    let contexts = |levels: &[u8]| {
        let mut contexts = vec![Context::EMPTY; count];
        packed::prepare_contexts(levels, rate, &mut contexts);
        contexts
    };
    let (predicted, unpredicted) =
        (contexts(&model.predicted_levels), contexts(&model.reset_levels));
    let mut coded = Coded {
        states: Vec::with_capacity(coefficients.len()),
        magnitudes: Vec::with_capacity(coefficients.len()),
        bytes: Vec::new(),
        histogram: Box::new([[[0; MAGNITUDES]; LEVELS]; 2]),
    };
    let mut survivors = vec![0; count];
    let mut magnitudes = vec![Magnitude::default(); count];
    let mut bytes = [0; MAX_BYTES];
    let mut state = vec![0; count];
    for (index, coefficients) in coefficients.chunks_exact(count).enumerate() {
        let is_reset = index % reset == 0;
        let contexts = if is_reset { &unpredicted } else { &predicted };
        state = if is_reset { vec![0; count] } else { model.predict(&state) };
        let residual: Vec<i32> = coefficients
            .iter()
            .zip(&state)
            .map(|(&coefficient, &prediction)| i32::from(coefficient) - i32::from(prediction))
            .collect();
        packed::quantise(&residual, contexts, &tables, rate, &mut survivors, &mut magnitudes);
        let header = Header { rate, is_reset };
        let length = packed::write_block(header, rate, &magnitudes, contexts, &tables, &mut bytes);
        coded.bytes.push(length);
        for symbol in packed::symbols(&magnitudes, contexts) {
            let magnitude = usize::from(symbol.magnitude.value).min(MAGNITUDES - 1);
            coded.histogram[symbol.quantiser][symbol.level][magnitude] += 1;
        }
        packed::update_state(&magnitudes, rate, &mut state);
        coded.states.extend_from_slice(&state);
        coded.magnitudes.extend(magnitudes.iter().map(|magnitude| {
            let value = i32::from(magnitude.value);
            if magnitude.is_negative { -value } else { value }
        }));
    }
    coded
}

pub(crate) fn sum(coded: &[Coded]) -> Box<Histogram> {
    let mut sum = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    for coded in coded {
        let counts = coded.histogram.iter().flatten().flatten();
        for (sum, count) in sum.iter_mut().flatten().flatten().zip(counts) {
            *sum += count;
        }
    }
    sum
}
