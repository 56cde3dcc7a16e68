//! The benchmark `lossless`: compresses samples, counts bits and instructions, and compares the
//! bytes with this PC's.

use emulator::{Image, MACHINES, Machine};
use lossless::{Count, Decoder, EncoderState, MAX_SAMPLES};
use model::CHANNELS;
use pipeline::Sample;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::figures::Report;
use super::images;
use super::inputs::{self, Inputs};
use crate::compression::{BLOCKS, ENCODER, OUTPUT_BYTES, SILENCE, Samples, to_bytes};
use crate::tally::Tally;

/// Name of the input whose figures have limits.
const EEG: &str = "synthetic EEG";

/// Number of ADC counts in a block: one for each channel and sample.
#[expect(clippy::cast_precision_loss, reason = "at most 512")]
const COUNTS: f64 = (CHANNELS * MAX_SAMPLES) as f64;

/// What the image `lossless` prints, as TOML.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Printed {
    state_bytes: usize,
    inputs: Vec<Tally>,
}

/// Figures of all inputs on one emulated machine.
#[derive(Debug, Serialize)]
struct Counts {
    machine: &'static str,
    core: &'static str,
    different_blocks: usize,
    inputs: Vec<Input>,
}

/// Figures of one input on one machine. `per_sample` in a name means per sample of one channel.
#[derive(Debug, Serialize)]
struct Input {
    name: &'static str,
    bits_per_sample: f64,
    insn_per_sample: f64,
    insn_fewest_block: u32,
    insn_worst_block: u32,
}

/// Compressed blocks of all inputs, as this PC computes them.
#[derive(Debug)]
struct Expected {
    output: Vec<u8>,
    /// For each input, the mean number of compressed bits per sample of one channel.
    bits: Vec<f64>,
}

/// Runs the image on each machine and compares the compressed blocks with those of this PC.
///
/// # Errors
/// QEMU or the target is missing, the image does not build or run, or an input cannot be made.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let image = Image::build("bench", "lossless", &[])?;
    let inputs = inputs::samples(BLOCKS * MAX_SAMPLES)?;
    let expected = Expected::new(&inputs)?;
    let bytes = inputs.data.iter().flatten().flat_map(|sample| sample.counts);
    let bytes: Vec<u8> = bytes.flat_map(to_count).collect();
    let mut machines = Vec::new();
    let mut state_bytes = 0;
    for machine in MACHINES {
        let length = expected.output.len();
        let (printed, output) =
            images::run::<Printed>(&image, machine, "bench/lossless", &bytes, length)?;
        state_bytes = printed.state_bytes;
        machines.push(Counts::new(machine, &printed, &output, &inputs, &expected));
    }
    report(&machines, state_bytes, &inputs.skipped)
}

impl Expected {
    /// Compresses all inputs on this PC and decompresses every block.
    ///
    /// # Errors
    /// A block differs after decompression.
    fn new(inputs: &Inputs<Sample>) -> anyhow::Result<Self> {
        let mut expected = Self { output: Vec::new(), bits: Vec::new() };
        for samples in &inputs.data {
            let (mut state, mut decoder) = (EncoderState::NEW, Decoder::<CHANNELS>::NEW);
            let mut bytes = 0;
            for samples in samples.as_chunks::<MAX_SAMPLES>().0 {
                let samples: Samples = samples.map(|sample| sample.counts.map(to_count));
                let mut room = SILENCE;
                let block = ENCODER.encode(&mut state, &samples, &mut room);
                let decoded = decoder.decode(CHANNELS, &block)?;
                anyhow::ensure!(decoded == samples.as_flattened(), "a block came back changed");
                bytes += block.bytes.len();
                expected.output.extend(to_bytes(&block));
            }
            #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
            let bits = 8.0 * bytes as f64 / (COUNTS * BLOCKS as f64);
            expected.bits.push(bits);
        }
        Ok(expected)
    }
}

impl Counts {
    fn new(
        machine: Machine,
        printed: &Printed,
        output: &[u8],
        inputs: &Inputs<Sample>,
        expected: &Expected,
    ) -> Self {
        let inputs = inputs.names.iter().zip(&printed.inputs).zip(&expected.bits);
        #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
        let inputs = inputs.map(|((name, tally), bits)| Input {
            name,
            bits_per_sample: *bits,
            insn_per_sample: tally.total as f64 / (COUNTS * BLOCKS as f64),
            insn_fewest_block: tally.fewest,
            insn_worst_block: tally.most,
        });
        Self {
            machine: machine.name,
            core: machine.core,
            different_blocks: images::different(&expected.output, output, OUTPUT_BYTES),
            inputs: inputs.collect(),
        }
    }
}

fn to_count(count: i32) -> Count {
    let [low, middle, high, _] = count.to_le_bytes();
    [low, middle, high]
}

fn report(machines: &[Counts], state_bytes: usize, skipped: &[String]) -> anyhow::Result<Report> {
    let eeg = machines[0].inputs.iter().find(|input| input.name == EEG);
    let all = machines.iter().flat_map(|machine| &machine.inputs);
    let figures = json!({
        "lossless_bits_per_sample": eeg.map(|eeg| eeg.bits_per_sample),
        "lossless_insn_per_sample": eeg.map(|eeg| eeg.insn_per_sample),
        "lossless_insn_worst_block": all.map(|input| input.insn_worst_block).max(),
        "bytes_equal": machines.iter().all(|machine| machine.different_blocks == 0),
        "state_bytes": state_bytes,
        "machines": machines,
        "skipped": skipped,
    });
    let next = "compare the instructions of `kernels/lossless/src/encoder.rs` with those of the last commit";
    Report::new("lossless", figures, next)
}
