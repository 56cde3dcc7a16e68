//! The benchmark `filters`: instructions, noise and response, with pictures.

mod inputs;
mod noise;
mod spectrum;

use std::path::Path;

use emulator::{Image, MACHINES, Machine};
use fixed_dsp::BLOCK;
use model::ELECTRODES;
use serde_json::{Value as Json, json};

use self::noise::Noise;
use super::failure::Failure;
use super::figures::Report;
use super::images::{self, Lines, Tallies};
use super::inputs::Inputs;
use super::{checked_in, tools};
use crate::block::{self, BYTES, Block};
use crate::contenders::{NAMES, with_contenders};
use crate::response::{Response, Twin};

/// Index in [`NAMES`] of the contender whose figures have limits.
const OURS: usize = 0;
/// Index in [`NAMES`] of the contender whose output must equal that of the one before it.
const SINGLES: usize = 1;
/// Index in [`NAMES`] of the contender with which ours is compared.
const IDSP_DITHER: usize = 5;

#[derive(Debug)]
struct Counts {
    machine: Machine,
    /// Tallies of instructions, with one column for each contender.
    tallies: Tallies,
    /// Number of blocks of each contender whose bits differ from those of the portable filters.
    different: [usize; NAMES.len()],
}

impl Counts {
    /// Returns the fewest and the most instructions per sample and electrode of one contender.
    fn per_sample(&self, contender: usize) -> [f64; 2] {
        let samples = f64::from(u32::try_from(BLOCK * ELECTRODES).unwrap_or(u32::MAX));
        let range = self.tallies.range(contender);
        range.map(|count| f64::from(count) / samples)
    }
}

/// Counts the instructions, measures the noise, and draws the pictures.
///
/// # Errors
/// QEMU or the target is missing, the image does not build or run, or an input or picture cannot be made.
pub(crate) fn measure() -> Result<Report, Failure> {
    let image = Image::build("bench", "filters", &[])?;
    let inputs = inputs::inputs()?;
    tools::print_skipped(&inputs.skipped);
    let blocks = inputs.data.iter().flatten();
    let bytes: Vec<u8> = blocks.flat_map(block::to_bytes).collect();
    let expected = expected(&inputs);
    let lines = inputs.names.len() * NAMES.len();
    let progress = tools::progress_bar(MACHINES.len() * lines + Noise::FILTERS.len());
    let mut machines = Vec::new();
    for machine in MACHINES {
        let folder = image.create_folder(Path::new("bench").join(machine.name))?;
        let (lines, output) = images::run(&image, machine, &folder, &bytes, &expected, &progress)?;
        machines.push(Counts {
            machine,
            tallies: tallies(&lines, inputs.names.len())
                .map_err(|why| images::mismatch(machine, why))?,
            different: different(&expected, &output),
        });
    }
    let twin = Twin::new(&checked_in::artifact()?.description.filters);
    let noise = Noise::measure(&twin, |filter| {
        progress.inc(1);
        progress.set_message(format!("noise of {filter}"));
    });
    progress.finish_and_clear();
    draw(&twin, &noise, &image.create_folder("bench")?)?;
    report(&inputs, &machines, &noise)
}

/// Returns the file that an image should write: the outputs of all contenders on this PC.
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

fn tallies(lines: &[String], inputs: usize) -> Result<Tallies, String> {
    let mut lines = Lines::parse(lines)?;
    let tallies = Tallies::remove(&mut lines, "count", inputs, &NAMES)?;
    lines.finish()?;
    Ok(tallies)
}

/// Returns, for each contender, the number of blocks in `output` that differ from `expected`.
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

fn draw(twin: &Twin, noise: &Noise, folder: &Path) -> Result<(), Failure> {
    let response = Response::measure(twin);
    for (name, curves) in [
        ("filters-response.svg", response.magnitude()),
        ("filters-group-delay.svg", response.group_delay()),
        ("filters-noise.svg", noise.chart()),
    ] {
        curves.draw(&folder.join(name)).map_err(|error| {
            let next = format!("is {} writable, and the disk not full?", folder.display());
            Failure::new("drawing the pictures", error, next)
        })?;
    }
    eprintln!("pictures: {}", folder.display());
    Ok(())
}

fn report(inputs: &Inputs<Block>, machines: &[Counts], noise: &Noise) -> Result<Report, Failure> {
    let extreme = |contender, end: usize, pick: fn(f64, f64) -> f64| {
        let figures = machines.iter().map(|each| each.per_sample(contender)[end]);
        figures.reduce(pick).unwrap_or(f64::NAN)
    };
    let most = extreme(OURS, 1, f64::max);
    let varying = blamed(machines, |counts, contender| {
        NAMES[contender].starts_with("ours") && !counts.tallies.is_constant(contender)
    });
    let different = blamed(machines, |counts, contender| {
        counts.different[contender] > 0
    });
    let next = "compare with `git log` of fixed-dsp, model and the toolchain";
    let mut report = Report::new("filters", next);
    // Our filters in blocks of 4 samples: the worst block on either machine.
    report.figure("insn_per_sample_channel", "instructions", most);
    // Our filters from 0.5 to 60 Hz, with offset, mains and EEG.
    report.figure("noise_nv_rms", "nV", noise.ours_nv_rms());
    // Instructions of idsp's best block over those of our worst block.
    let ratio = extreme(IDSP_DITHER, 0, f64::min) / most;
    report.figure("ratio_idsp_dither", "times ours", ratio);
    report.flag("constant_count", varying);
    report.flag("bits_equal", different);
    report.detail("machines", machines.iter().map(json).collect::<Json>());
    report.detail("noise_nv", noise.json());
    report.detail("inputs", inputs.names.clone());
    report.detail("skipped", inputs.skipped.clone());
    report.detail("published_elsewhere", checked_in::published("filters")?);
    Ok(report)
}

/// Lists the contenders, with their machines, for which `is_faulty` holds.
fn blamed(machines: &[Counts], is_faulty: impl Fn(&Counts, usize) -> bool) -> String {
    let mut blamed = Vec::new();
    for counts in machines {
        for (contender, name) in NAMES.iter().enumerate() {
            if is_faulty(counts, contender) {
                blamed.push(format!("{name} on {}", counts.machine.name));
            }
        }
    }
    blamed.join(", ")
}

fn json(counts: &Counts) -> Json {
    let contenders = NAMES.iter().enumerate().map(|(contender, name)| {
        let [fewest, most] = counts.per_sample(contender);
        json!({
            "name": name,
            "fewest": fewest,
            "most": most,
            "constant": counts.tallies.is_constant(contender),
            "different_blocks": counts.different[contender],
        })
    });
    json!({
        "machine": counts.machine.name,
        "core": counts.machine.core,
        "contenders": contenders.collect::<Json>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Report of one machine, on which ours takes 5500 instructions per block and each peer 13420.
    fn report_of(different: [usize; NAMES.len()], varying: Option<usize>) -> Report {
        let counts = NAMES.map(|name| {
            if name.starts_with("ours") {
                5_500
            } else {
                13_420
            }
        });
        let machine = Counts {
            machine: MACHINES[0],
            tallies: Tallies::of_two_inputs(&counts, varying),
            different,
        };
        report(&Inputs::new(), &[machine], &Noise::of_2_4_nv()).expect("a report")
    }

    #[test]
    fn figures_are_per_sample_and_electrode_and_the_ratio_is_that_to_idsps_dither() {
        let names = [NAMES[OURS], NAMES[IDSP_DITHER]];
        assert_eq!(names, ["ours-blocks", "idsp-dither"]);
        let report = report_of([0; NAMES.len()], None);
        let json = report.json();
        let instructions = json["insn_per_sample_channel"].as_f64().expect("a number");
        assert!((instructions - 5_500.0 / 244.0).abs() < 1e-12);
        assert_eq!(json["ratio_idsp_dither"], 2.44);
        assert_eq!(json["noise_nv_rms"], 2.4);
        assert_eq!(json["constant_count"], true);
        assert_eq!(json["noise_nv"]["idsp_wide"]["silence"], 0.0);
        assert_eq!(json["machines"][0]["contenders"][5]["name"], "idsp-dither");
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn a_contender_that_varies_or_differs_is_named_with_its_machine() {
        let fault = |report: Report| {
            let faults = report.faults();
            assert_eq!(faults.len(), 1, "{faults:?}");
            faults[0].clone()
        };
        let varying = fault(report_of([0; NAMES.len()], Some(1)));
        let words = "constant_count is false (ours-singles on mps2-an386)";
        assert!(varying.starts_with(words), "{varying}");
        // A peer's count may vary with the input: that is no fault.
        let peer = report_of([0; NAMES.len()], Some(IDSP_DITHER));
        assert_eq!(peer.faults(), [""; 0]);
        let mut blocks = [0; NAMES.len()];
        blocks[IDSP_DITHER] = 1;
        let different = fault(report_of(blocks, None));
        let words = "bits_equal is false (idsp-dither on mps2-an386)";
        assert!(different.starts_with(words), "{different}");
    }

    #[test]
    fn a_single_different_bit_is_counted_for_its_contender() {
        let expected = vec![0; 2 * NAMES.len() * BYTES];
        let mut output = expected.clone();
        output[(NAMES.len() + 2) * BYTES + 17] = 1;
        let mut counted = [0; NAMES.len()];
        counted[2] = 1;
        assert_eq!(different(&expected, &output), counted);
    }

    #[test]
    fn single_samples_must_give_the_output_of_blocks() {
        let names = [NAMES[SINGLES - 1], NAMES[SINGLES]];
        assert_eq!(names, ["ours-blocks", "ours-singles"]);
        let mut outputs = vec![0; NAMES.len() * BYTES];
        outputs[SINGLES * BYTES] = 1;
        assert_eq!(different(&outputs, &outputs)[SINGLES], 1);
    }
}
