//! The benchmark `filters`: compares filters by their instructions and their noise.

mod noise;

use emulator::{Image, MACHINES, Machine};
use fixed_dsp::BLOCK;
use model::ELECTRODES;
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::noise::Noise;
use super::checked_in;
use super::figures::Report;
use super::images::{self, Range};
use super::inputs::{self, Inputs};
use crate::block::{self, BYTES, Block};
use crate::contenders::{NAMES, with_contenders};
use crate::tally::Tally;
use demo::response::Twin;

/// Name of the contender (compared filter) whose figures have limits.
const OURS: &str = "ours-blocks";
/// Name of the contender (compared filter) whose instructions are compared with those of [`OURS`].
const IDSP_DITHER: &str = "idsp-dither";
/// Index in [`NAMES`] of our filters, run sample by sample. Their output must equal that of
/// [`OURS`], the contender before them.
const SINGLES: usize = 1;

/// The output of the image `filters`: for each input, the tallies of all contenders.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Printed {
    inputs: Vec<Vec<Tally>>,
}

/// Instruction counts of all compared filter implementations on one machine.
#[derive(Debug, Serialize)]
struct Counts {
    machine: &'static str,
    core: &'static str,
    /// Instruction counts of each contender, in the order of [`NAMES`].
    contenders: Vec<Contender>,
}

#[derive(Debug, Serialize)]
struct Contender {
    name: &'static str,
    /// Fewest instructions of any block, per sample and electrode.
    fewest: f64,
    /// Most instructions of any block, per sample and electrode.
    most: f64,
    /// Whether the number of instructions is the same for every input.
    constant: bool,
    /// Number of output blocks that differ in any bit from the output of the same contender on this
    /// PC.
    different_blocks: usize,
}

impl Counts {
    fn new(machine: Machine, ranges: &[Range], different: [usize; NAMES.len()]) -> Self {
        let samples = f64::from(u32::try_from(BLOCK * ELECTRODES).unwrap_or(u32::MAX));
        let contenders = NAMES.into_iter().zip(ranges).zip(different);
        let contenders = contenders.map(|((name, range), different_blocks)| Contender {
            name,
            fewest: f64::from(range.fewest) / samples,
            most: f64::from(range.most) / samples,
            constant: range.constant,
            different_blocks,
        });
        Self { machine: machine.name, core: machine.core, contenders: contenders.collect() }
    }
}

/// Counts the contenders' instructions and measures the noise.
///
/// # Errors
/// QEMU or the target is missing, the image does not build or run, or an input cannot be made.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let image = Image::build("bench", "filters", &[])?;
    let inputs = inputs::blocks()?;
    let bytes = inputs.data.iter().flatten().flat_map(block::to_bytes);
    let bytes: Vec<u8> = bytes.collect();
    let expected = expected(&inputs);
    let mut machines = Vec::new();
    for machine in MACHINES {
        let (Printed { inputs }, output) =
            images::run(&image, machine, "bench", &bytes, expected.len())?;
        let ranges = Range::of_columns(&inputs, NAMES.len())?;
        machines.push(Counts::new(machine, &ranges, different(&expected, &output)));
    }
    let twin = Twin::new(&checked_in::artifact()?.description.filters);
    eprintln!("measuring the noise of our filters and of idsp's");
    let noise = Noise::measure(&twin);
    report(&inputs, &machines, &noise)
}

/// Returns the output file that this PC computes with all contenders.
fn expected(inputs: &Inputs<Block>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for input in &inputs.data {
        with_contenders(|mut contenders| {
            for block in input {
                for contender in &mut contenders {
                    contender.load(block);
                    contender.run();
                    bytes.extend(block::to_bytes(&contender.output()));
                }
            }
        });
    }
    bytes
}

/// Returns, for each contender, the number of blocks in `output` that are not as in `expected`.
fn different(expected: &[u8], output: &[u8]) -> [usize; NAMES.len()] {
    let [expected, output] = [expected, output].map(|bytes| bytes.as_chunks::<BYTES>().0);
    let mut different = [0; NAMES.len()];
    for (index, block) in output.iter().enumerate() {
        let contender = index % NAMES.len();
        let twin = index - usize::from(contender == SINGLES);
        different[contender] += usize::from(expected[twin] != *block);
    }
    different
}

fn report(inputs: &Inputs<Block>, machines: &[Counts], noise: &Noise) -> anyhow::Result<Report> {
    let all = || machines.iter().flat_map(|counts| &counts.contenders);
    let ours = all().filter(|each| each.name == OURS);
    let most = ours.map(|each| each.most).fold(0.0, f64::max);
    let peer = all().filter(|each| each.name == IDSP_DITHER);
    let peer = peer.map(|each| each.fewest).fold(f64::INFINITY, f64::min);
    let mut all_ours = all().filter(|each| each.name.starts_with("ours"));
    let figures = json!({
        // Largest instruction count of our filters, four samples at a time, over all inputs and
        // both machines.
        "insn_per_sample_channel": most,
        // Noise of our filters from 0.5 to 60 Hz; the signal is electrode offset, mains and EEG.
        "noise_nv_rms": noise.ours.eeg,
        // Fewest instructions of idsp's filter, divided by the most of ours.
        "ratio_idsp_dither": peer / most,
        // Our filters alone must have constant counts; idsp's may vary with the input.
        "constant_count": all_ours.all(|each| each.constant),
        "bits_equal": all().all(|each| each.different_blocks == 0),
        "machines": machines,
        "noise_nv": noise,
        "inputs": inputs.names,
        "skipped": inputs.skipped,
    });
    let next = "see `machines`; compare with `git log` of fixed-dsp, model and the toolchain";
    Report::new("filters", figures, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a report on one machine, whose counts `change` alters. Our contenders take 25
    /// instructions per sample and electrode, idsp's 61.
    fn report_of(change: fn(&mut Contender)) -> Report {
        let of_block =
            |each: usize| u32::try_from(each * BLOCK * ELECTRODES).expect("some thousands");
        let range = |name: &str| {
            let instructions = of_block(if name.starts_with("ours") { 25 } else { 61 });
            Range { fewest: instructions, most: instructions, constant: true }
        };
        let ranges = NAMES.map(range);
        let mut counts = Counts::new(MACHINES[0], &ranges, [0; NAMES.len()]);
        counts.contenders.iter_mut().for_each(change);
        let mut noise = Noise::default();
        noise.ours.eeg = 2.4;
        report(&Inputs::new(), &[counts], &noise).expect("a report")
    }

    #[test]
    fn figures_are_per_sample_and_electrode_and_the_ratio_is_that_to_idsps_dither() {
        let report = report_of(|_| ());
        let json = &report.object;
        let instructions = json["insn_per_sample_channel"].as_f64().expect("a number");
        assert!((instructions - 25.0).abs() < 1e-12);
        assert_eq!(json["ratio_idsp_dither"], 2.44);
        assert_eq!(json["noise_nv_rms"], 2.4);
        assert_eq!(json["noise_nv"]["idsp_wide"]["silence"], 0.0);
        assert_eq!(json["machines"][0]["contenders"][5]["name"], "idsp-dither");
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn a_contender_of_ours_that_varies_or_any_that_differs_is_a_fault() {
        let varying = report_of(|each| each.constant = each.name != "ours-singles");
        let different =
            report_of(|each| each.different_blocks = (each.name == "idsp-dither").into());
        for (report, words) in
            [(varying, "constant_count is false;"), (different, "bits_equal is false;")]
        {
            report.assert_only_fault(words);
        }
        let peer = report_of(|each| each.constant = each.name != "idsp-dither");
        assert_eq!(peer.faults(), [""; 0]);
    }

    #[test]
    fn a_different_bit_is_counted_and_single_samples_must_give_the_output_of_blocks() {
        let names = [NAMES[SINGLES - 1], NAMES[SINGLES]];
        assert_eq!(names, [OURS, "ours-singles"]);
        let silence = vec![0; NAMES.len() * BYTES];
        for (changed, contender) in [(2, 2), (SINGLES, SINGLES)] {
            let mut output = silence.clone();
            output[changed * BYTES + 17] = 1;
            let mut counted = [0; NAMES.len()];
            counted[contender] = 1;
            assert_eq!(different(&silence, &output), counted);
        }
        let mut both = silence.clone();
        both[SINGLES * BYTES] = 1;
        assert_eq!(different(&both, &both)[SINGLES], 1);
    }
}
