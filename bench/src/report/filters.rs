//! The benchmark `filters`: instructions, noise and response, with pictures.

mod inputs;
mod noise;
mod spectrum;
mod tallies;

use std::path::Path;

use emulator::{Image, MACHINES};
use model::{ELECTRODES, SECTIONS};
use serde_json::{Value as Json, json};

use self::inputs::Inputs;
use self::noise::{InBand, Noise};
use self::tallies::Tallies;
use super::checked_in::{self, PublishedFilters};
use super::failure::Failure;
use super::figures::Report;
use super::table::Table;
use super::{artifact, images, progress};
use crate::block::{self, BLOCKS};
use crate::contenders::{NAMES, with_contenders};
use crate::response::{Response, Twin};

/// Index in [`NAMES`] of the contender whose figures have limits.
const OURS: usize = 0;
/// Index in [`NAMES`] of the contender with which ours is compared.
const IDSP_DITHER: usize = 5;

/// Counts the instructions, measures the noise, and draws the pictures.
///
/// # Errors
/// QEMU or the target is missing, the image does not build or run, or an input or picture cannot be made.
pub(crate) fn measure() -> Result<Report, Failure> {
    let image = Image::build("bench", "filters", &[])?;
    let inputs = Inputs::new()?;
    progress::skipped(&inputs.skipped);
    let expected = expected(&inputs);
    let lines = inputs.names.len() * NAMES.len();
    let progress = progress::bar(MACHINES.len() * lines + Noise::FILTERS);

    let mut machines = Vec::new();
    for machine in MACHINES {
        let folder = image.create_folder(Path::new("bench").join(machine.name))?;
        let output = images::run(&image, machine, &folder, &inputs.bytes, &progress)?;
        machines.push(Tallies::new(
            machine,
            output,
            inputs.names.len(),
            &expected,
        )?);
    }
    let twin = Twin::new(&artifact()?.description.filters);
    let noise = Noise::measure(&twin, |filter| {
        progress.inc(1);
        progress.set_message(filter);
    });
    progress.finish_and_clear();
    draw(&twin, &noise, &image.create_folder("bench")?)?;
    report(&inputs, &machines, &noise)
}

/// Returns the file that an image should write: the outputs of all contenders on this PC.
fn expected(inputs: &Inputs) -> Vec<u8> {
    let mut bytes = Vec::new();
    for input in inputs.blocks.chunks(BLOCKS) {
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

fn report(inputs: &Inputs, machines: &[Tallies], noise: &Noise) -> Result<Report, Failure> {
    let extreme = |contender, end: usize, pick: fn(f64, f64) -> f64| {
        let figures = machines.iter().map(|each| each.per_sample(contender)[end]);
        figures.reduce(pick).unwrap_or(f64::NAN)
    };
    let most = extreme(OURS, 1, f64::max);
    let varying = blamed(machines, |machine, contender| {
        NAMES[contender].starts_with("ours") && !machine.is_constant(contender)
    });
    let different = blamed(machines, |machine, contender| {
        machine.different[contender] > 0
    });

    let next = "compare with `git log` of fixed-dsp, model and the toolchain";
    let mut report = Report::new("filters", next);
    // Ours in blocks of 4 samples, the worst block on either machine.
    report.figure("insn_per_sample_channel", "instructions", most);
    // Ours from 0.5 to 60 Hz, with offset, mains and EEG.
    report.figure("noise_nv_rms", "nV", noise.ours.in_band.eeg);
    // Instructions of idsp's best block over those of our worst.
    let ratio = extreme(IDSP_DITHER, 0, f64::min) / most;
    report.figure("ratio_idsp_dither", "times ours", ratio);
    report
        .figure("constant_count", "", varying.is_empty())
        .blamed = varying;
    report
        .figure("bits_equal", "", different.is_empty())
        .blamed = different;

    let published = checked_in::published()?.filters;
    let in_band = [
        ("ours", &noise.ours.in_band),
        ("idsp_dither", &noise.idsp_dither.in_band),
        ("idsp_wide", &noise.idsp_wide.in_band),
    ];
    report.detail("machines", machines.iter().map(json).collect::<Json>());
    let noise_nv = in_band.map(|(name, noise)| (name, json!(noise)));
    report.detail("noise_nv", Json::from_iter(noise_nv));
    report.detail("inputs", inputs.names.clone());
    report.detail("skipped", inputs.skipped.clone());
    report.detail("published_elsewhere", json!(published));

    report.table(instructions_table(machines, &inputs.names));
    report.table(published_table(&published));
    report.table(noise_table(&in_band));
    Ok(report)
}

/// Names the contenders on their machines for which `is_faulty` holds.
fn blamed(machines: &[Tallies], is_faulty: impl Fn(&Tallies, usize) -> bool) -> String {
    let mut blamed = Vec::new();
    for tallies in machines {
        for (contender, name) in NAMES.iter().enumerate() {
            if is_faulty(tallies, contender) {
                blamed.push(format!("{name} on {}", tallies.machine.name));
            }
        }
    }
    blamed.join(", ")
}

fn json(tallies: &Tallies) -> Json {
    let contenders = NAMES.iter().enumerate().map(|(contender, name)| {
        let [fewest, most] = tallies.per_sample(contender);
        json!({
            "name": name,
            "fewest": fewest,
            "most": most,
            "constant": tallies.is_constant(contender),
            "different_blocks": tallies.different[contender],
        })
    });
    json!({
        "machine": tallies.machine.name,
        "core": tallies.machine.core,
        "contenders": contenders.collect::<Json>(),
    })
}

fn instructions_table(machines: &[Tallies], inputs: &[&str]) -> Table {
    let mut table = Table::new(format!(
        "Instructions per sample and electrode over {}; {ELECTRODES} electrodes, {SECTIONS} sections \
         (a range: fewest and most of a block; *: depends on the input)",
        inputs.join(", ")
    ));
    table.row("", machines.iter().map(|each| each.machine.core));
    for (contender, name) in NAMES.iter().enumerate() {
        let cell = |tallies: &Tallies| {
            let [fewest, most] = tallies.per_sample(contender);
            let mark = if tallies.is_constant(contender) { "" } else { "*" };
            if most - fewest < 0.05 {
                format!("{most:.1}{mark}")
            } else {
                format!("{fewest:.1}-{most:.1}{mark}")
            }
        };
        table.row(*name, machines.iter().map(cell));
    }
    table
}

fn published_table(published: &[PublishedFilters]) -> Table {
    let mut table = Table::new("Published elsewhere, on other code and settings");
    table.row("", ["instructions", "in-band noise"]);
    for other in published {
        let [low, high] = other.insn_per_sample_channel;
        let range = if low == high {
            low.to_string()
        } else {
            format!("{low}-{high}")
        };
        table.row(&other.name, [range, other.noise.clone()]);
    }
    table
}

fn noise_table(in_band: &[(&str, &InBand)]) -> Table {
    let mut table = Table::new("Noise in 0.5-60 Hz against a float64 twin, nV rms");
    table.row("", ["offset, mains, EEG", "mains", "silence"]);
    for (name, noise) in in_band {
        let cells = [noise.eeg, noise.mains, noise.silence];
        table.row(*name, cells.map(|nv| format!("{nv:.2}")));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::super::limits;
    use super::super::value::Value;
    use super::*;

    /// Report with all figures within their limits.
    fn sound(machines: &[Tallies]) -> Report {
        let inputs = Inputs {
            names: vec!["silence", "noise"],
            ..Inputs::default()
        };
        let mut report = report(&inputs, machines, &Noise::of_2_4_nv()).expect("a report");
        report.set("insn_per_sample_channel", 55.0);
        report.set("ratio_idsp_dither", 2.2);
        report
    }

    fn fault(mut report: Report) -> String {
        report.judge(&limits::read("filters").expect("limits.toml"));
        let json = serde_json::to_value(&report).expect("JSON");
        assert_eq!(json["faults"].as_array().map(Vec::len), Some(1), "{json}");
        let failure = report.outcome().expect_err("a limit is exceeded");
        failure.to_string()
    }

    #[test]
    fn the_ratio_is_that_of_the_two_contenders_that_it_names() {
        assert_eq!(
            [NAMES[OURS], NAMES[IDSP_DITHER]],
            ["ours-blocks", "idsp-dither"]
        );
    }

    #[test]
    fn every_limit_is_judged_and_named() {
        let mut report = sound(&[tallies::tests::sound()]);
        report.judge(&limits::read("filters").expect("limits.toml"));
        assert!(report.outcome().is_ok(), "{:?}", report.outcome());
        let exceeded: [(&str, Value, &str); 4] = [
            ("insn_per_sample_channel", 58.1.into(), "58.1 instructions"),
            ("noise_nv_rms", 2.61.into(), "2.61 nV"),
            ("noise_nv_rms", f64::NAN.into(), "NaN nV"),
            ("ratio_idsp_dither", 1.99.into(), "1.99 times"),
        ];
        for (name, value, words) in exceeded {
            let mut report = sound(&[tallies::tests::sound()]);
            report.set(name, value);
            let fault = fault(report);
            assert!(fault.contains(words), "{fault}");
        }
    }

    #[test]
    fn a_contender_that_varies_or_differs_is_named_with_its_machine() {
        let varying = sound(&[tallies::tests::varying(OURS)]);
        let words = "constant_count is false (ours-blocks on mps2-an386)";
        assert!(fault(varying).contains(words));
        // The peer may vary.
        let mut peer = sound(&[tallies::tests::varying(IDSP_DITHER)]);
        peer.judge(&limits::read("filters").expect("limits.toml"));
        assert!(peer.outcome().is_ok());
        let mut different = tallies::tests::sound();
        different.different[IDSP_DITHER] = 1;
        let words = "bits_equal is false (idsp-dither on mps2-an386)";
        assert!(fault(sound(&[different])).contains(words));
    }

    #[test]
    fn the_json_is_one_object_with_the_figures() {
        let text = serde_json::to_string(&sound(&[tallies::tests::sound()])).expect("JSON");
        let json: Json = serde_json::from_str(&text).expect("JSON");
        assert_eq!(json["insn_per_sample_channel"], 55.0);
        assert_eq!(json["noise_nv_rms"], 2.4);
        assert_eq!(json["ratio_idsp_dither"], 2.2);
        assert_eq!(json["constant_count"], true);
        assert_eq!(json["noise_nv"]["idsp_wide"]["silence"], 0.0);
        assert_eq!(json["machines"][0]["contenders"][0]["name"], "ours-blocks");
        assert!(!text.contains('\n'));
    }
}
