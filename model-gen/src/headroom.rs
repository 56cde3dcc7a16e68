//! Proof that no node of a cascade can leave 32 bits.

use fixed_dsp::{Section, Shape};

use crate::{FilterError, response};

/// Bits below a count that a filtered sample carries: format Q28.4.
pub const GUARD_BITS: u32 = 4;

/// An ADC count is a 24-bit two's-complement number: |count| <= 2^23.
const ADC_BITS: u32 = 24;

/// What the rounding noise of the whole cascade can add to a node, as a part of full scale: 2^10
/// steps of Q28.4 (measured: 15).
const NOISE: f64 = 1.0 / 131_072.0;

/// Worst-case gain of one node of the cascade.
#[derive(Clone, Debug)]
pub struct NodeGain {
    /// Which signal, e.g. "output of section 3".
    pub node: String,
    /// L1 norm of the impulse response from the input to this node.
    pub gain: f64,
}

/// The worst-case gain of every number that a cascade holds in 32 bits: the numerator sum, the
/// notch's difference and the output of each section.
///
/// # Errors
/// When a full-scale input (2^23 counts with [`GUARD_BITS`]) could take one to 2^31.
pub fn prove(sections: &[Section]) -> Result<Vec<NodeGain>, FilterError> {
    let limit = f64::from(1_u32 << (32 - ADC_BITS - GUARD_BITS)) - NOISE;
    let mut gains = Vec::new();
    let mut input = vec![0.0; response::decay_samples(sections)?];
    input[0] = 1.0;
    for (index, section) in sections.iter().enumerate() {
        let output: Vec<f64> =
            response::filter(std::slice::from_ref(section), input.iter().copied()).collect();
        for (name, signal) in nodes(section.shape, &input, &output) {
            let node = format!("{name} of section {index}");
            let gain = signal.iter().map(|v| v.abs()).sum();
            if gain >= limit {
                return Err(FilterError::Overflow { node, gain, limit });
            }
            gains.push(NodeGain { node, gain });
        }
        input = output;
    }
    Ok(gains)
}

/// The signals that a section holds in 32 bits, from its input and output.
fn nodes(shape: Shape, input: &[f64], output: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
    let before = |signal: &[f64], index: usize, age: usize| {
        index
            .checked_sub(age)
            .map_or(0.0, |earlier| signal[earlier])
    };
    let combine = |middle: f64, last: f64| -> Vec<f64> {
        (0..input.len())
            .map(|k| input[k] + middle * before(input, k, 1) + last * before(input, k, 2))
            .collect()
    };
    let numerator = match shape {
        Shape::Notch => combine(0.0, 1.0),
        Shape::HighPass => combine(-2.0, 1.0),
        Shape::BandPass => combine(0.0, -1.0),
        Shape::LowPass => combine(2.0, 1.0),
    };
    let mut nodes = vec![("numerator", numerator), ("output", output.to_vec())];
    if shape == Shape::Notch {
        let difference = (0..input.len()).map(|k| input[k] - output[k]).collect();
        nodes.push(("difference", difference));
    }
    nodes
}
