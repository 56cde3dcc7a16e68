//! Proof that no node of a filter cascade (a signal within it) can overflow 32 bits.

use fixed_dsp::Section;

use crate::{chain::Chain, error::FilterError, response};

/// Number of fraction bits of a filtered sample below one count: format Q27.5. Each further bit
/// halves both the rounding noise and the head room; with five bits, the noise in the band is below
/// the ADC's rounding noise.
pub const GUARD_BITS: u32 = 5;

/// Width of an ADC count in bits. Counts are two's-complement numbers: |count| <= 2^23.
const ADC_BITS: u32 = 24;

/// Limit of the worst-case gain of every node: full scale of 32 bits divided by full scale of a
/// filtered sample.
pub(crate) const GAIN_LIMIT: u32 = 1 << (32 - ADC_BITS - GUARD_BITS);

/// Upper bound of the cascade's rounding noise at any node, as a fraction of full scale: 2^-17,
/// which is 2^11 units of Q27.5. The noise measured on EEG is a few units rms (docs/figures.md).
const NOISE: f64 = 1.0 / 131_072.0;

/// Worst-case gain from the input to one node, a signal within the filter chain.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeGain {
    /// Name of the node, for example "output of section 3".
    pub node: String,
    /// Worst-case gain: the L1 norm of the impulse response from the input to the node.
    pub gain: f64,
}

/// Returns the worst-case gains of all signals within a cascade that must fit 32 bits.
///
/// These signals are the outputs of all sections, the numerators of the sections that scale them,
/// and the change (output minus input) and balance (`2 y[n-2] - x[n] - x[n-2]`) of a notch.
/// Intermediate sums may wrap.
///
/// # Errors
/// If a full-scale input (2^23 counts with [`GUARD_BITS`]) could take one of these signals to 2^31.
pub fn prove_cascade(sections: &[Section]) -> Result<Vec<NodeGain>, FilterError> {
    let mut gains = Vec::new();
    let mut input = vec![0.0; response::decay_samples(sections)?];
    input[0] = 1.0;
    for (index, section) in sections.iter().enumerate() {
        let output: Vec<f64> =
            response::filter(std::slice::from_ref(section), input.iter().copied()).collect();
        for (name, signal) in nodes(section, &input, &output) {
            let gain = signal.iter().map(|v| v.abs()).sum();
            gains.push(checked_gain(format!("{name} of section {index}"), gain)?);
        }
        input = output;
    }
    Ok(gains)
}

/// Returns the worst-case gain from the ADC to the resampler's output.
///
/// # Errors
/// If a full-scale input could take the output to 2^31.
pub fn prove_chain_output(chain: &Chain) -> Result<NodeGain, FilterError> {
    checked_gain("output of the resampler".to_owned(), chain.worst_gain()?)
}

/// Returns the node with its gain, or an error if the gain lets a full-scale input overflow 32
/// bits.
fn checked_gain(node: String, gain: f64) -> Result<NodeGain, FilterError> {
    let limit = f64::from(GAIN_LIMIT) - NOISE;
    let node = NodeGain { node, gain };
    if gain < limit { Ok(node) } else { Err(FilterError::Overflow(node, limit)) }
}

/// Returns the name and the samples of each signal that must fit 32 bits in a section with this
/// input and output.
fn nodes(section: &Section, input: &[f64], output: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
    let before = |signal: &[f64], index: usize, age: usize| {
        index.checked_sub(age).map_or(0.0, |earlier| signal[earlier])
    };
    let each =
        |signal: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..input.len()).map(signal).collect() };
    let mut nodes = match section {
        Section::Notch { .. } => vec![
            ("change", each(&|k| output[k] - input[k])),
            ("balance", each(&|k| 2.0 * before(output, k, 2) - input[k] - before(input, k, 2))),
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
