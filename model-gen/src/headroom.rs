//! Proof that no node of a cascade can leave 32 bits.

use fixed_dsp::Section;

use crate::{Chain, FilterError, response};

/// Bits below a count that a filtered sample carries: format Q27.5. Each halves the rounding noise
/// and the head room; with five, the noise is below the ADC's own rounding in the band.
pub const GUARD_BITS: u32 = 5;

/// An ADC count is a 24-bit two's-complement number: |count| <= 2^23.
const ADC_BITS: u32 = 24;

/// Full scale fits 32 bits this many times: what every worst-case gain has to stay below.
pub(crate) const ROOM: u32 = 1 << (32 - ADC_BITS - GUARD_BITS);

/// What the rounding noise of the whole cascade can add to a node, as a part of full scale: 2^10
/// steps of Q27.5 (measured: 15).
const NOISE: f64 = 1.0 / 131_072.0;

/// Worst-case gain of one node of the cascade.
#[derive(Clone, Debug)]
pub struct NodeGain {
    /// Which signal, e.g. "output of section 3".
    pub node: String,
    /// L1 norm of the impulse response from the input to this node.
    pub gain: f64,
}

/// The worst-case gain of every number that a cascade multiplies or puts out, which has to fit 32
/// bits: the output of each section, the numerator of those that scale theirs, the notch's change
/// (output minus input) and balance (`2 y2 - x0 - x2`). Sums on the way to an output may wrap.
///
/// # Errors
/// When a full-scale input (2^23 counts with [`GUARD_BITS`]) could take one to 2^31.
pub fn prove(sections: &[Section]) -> Result<Vec<NodeGain>, FilterError> {
    let mut gains = Vec::new();
    let mut input = vec![0.0; response::decay_samples(sections)?];
    input[0] = 1.0;
    for (index, section) in sections.iter().enumerate() {
        let output: Vec<f64> =
            response::filter(std::slice::from_ref(section), input.iter().copied()).collect();
        for (name, signal) in nodes(section, &input, &output) {
            let gain = signal.iter().map(|v| v.abs()).sum();
            gains.push(fitting(format!("{name} of section {index}"), gain)?);
        }
        input = output;
    }
    Ok(gains)
}

/// The worst-case gain of a whole chain: that of the electrodes which it gives.
///
/// # Errors
/// As [`prove`].
pub fn prove_output(chain: &Chain) -> Result<NodeGain, FilterError> {
    fitting("output of the resampler".to_owned(), chain.worst_gain()?)
}

/// A node whose worst-case gain leaves it within 32 bits.
fn fitting(node: String, gain: f64) -> Result<NodeGain, FilterError> {
    let limit = f64::from(ROOM) - NOISE;
    if gain < limit {
        return Ok(NodeGain { node, gain });
    }
    Err(FilterError::Overflow { node, gain, limit })
}

/// The signals of a section that have to fit 32 bits, from its input and output.
fn nodes(section: &Section, input: &[f64], output: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
    let before = |signal: &[f64], index: usize, age: usize| {
        index
            .checked_sub(age)
            .map_or(0.0, |earlier| signal[earlier])
    };
    let each =
        |signal: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..input.len()).map(signal).collect() };
    let mut nodes = match section {
        Section::Notch { .. } => vec![
            ("change", each(&|k| output[k] - input[k])),
            (
                "balance",
                each(&|k| 2.0 * before(output, k, 2) - input[k] - before(input, k, 2)),
            ),
        ],
        Section::HighPass { .. } => Vec::new(),
        Section::BandPass { .. } => {
            vec![("difference", each(&|k| input[k] - before(input, k, 2)))]
        }
        Section::LowPass { .. } => vec![("pair", each(&|k| input[k] + before(input, k, 1)))],
    };
    nodes.push(("output", output.to_vec()));
    nodes
}
