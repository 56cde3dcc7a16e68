//! The benchmark `encoder`: instructions of each time step, memory, and the codes compared with the PC's.

mod counts;
mod cycles;
mod disassembly;
mod flash;
mod inputs;

use std::path::Path;

use emulator::{Image, MACHINES};
use model::{CODE, HOP};
use pipeline::{CodeValues, Encoder, Plane, Step};
use serde_json::{Value as Json, json};

use self::counts::Counts;
use self::cycles::{LoopCycles, Loops, REST_M4, REST_M7, load_percent};
use super::failure::Failure;
use super::figures::Report;
use super::inputs::Inputs;
use super::{checked_in, images, tools};
use crate::hop;

/// Number of lines that an image prints in addition to those of its inputs: memory, acquisition,
/// kernels.
const OTHER_LINES: usize = 8;

/// Encodes at least `windows` windows on each machine.
///
/// # Errors
/// QEMU or the target is missing, an image does not build or run, or an input cannot be made.
pub(crate) fn measure(windows: usize) -> Result<Report, Failure> {
    let inputs = inputs::inputs(windows)?;
    let bytes = inputs::file(&inputs);
    tools::print_skipped(&inputs.skipped);
    let mut expected = codes(&inputs);
    // The image appends the digests of random networks, as long as one code.
    expected.extend(crate::any_network::digests());
    let lines = inputs.names.len() * HOP + OTHER_LINES;
    let progress = tools::progress_bar(MACHINES.len() * lines);
    let mut machines = Vec::new();
    let mut flash_bytes = 0;
    for machine in MACHINES {
        let bare = Image::build("bench", "size", machine.features)?;
        flash_bytes = flash::loaded(bare.path())?.len().max(flash_bytes);
        let tasks = Image::build("bench", "tasks", machine.features)?;
        flash::check_panics(tasks.path())?;
        let image = Image::build("bench", "encoder", machine.features)?;
        let loops = Loops::read(machine, &image);
        tools::print_skipped(&loops.skipped);
        let folder = image.create_folder(Path::new("bench/encoder").join(machine.name))?;
        let (lines, output) = images::run(&image, machine, &folder, &bytes, &expected, &progress)?;
        let mut counts = Counts::parse(machine, &lines, inputs.names.len())
            .map_err(|why| images::mismatch(machine, why))?;
        counts.different = different(&expected, &output);
        machines.push((counts, loops));
    }
    progress.finish_and_clear();
    report(&inputs, &machines, flash_bytes)
}

/// Returns the codes that this PC computes; each input is encoded by a new encoder.
fn codes(inputs: &Inputs<Plane>) -> Vec<u8> {
    let mut codes = Vec::new();
    for planes in &inputs.data {
        let mut encoder = Encoder::new();
        for &plane in planes {
            let step = Step {
                plane,
                ..Step::default()
            };
            if let Some(code) = encoder.encode_step(&step) {
                codes.extend(code.values.to_bytes(&mut [0; CodeValues::MAX_BYTES]));
            }
        }
    }
    codes
}

/// Returns the number of codes in `output` that differ from those in `expected`.
fn different(expected: &[u8], output: &[u8]) -> usize {
    let codes = output.chunks(CODE).zip(expected.chunks(CODE));
    codes.filter(|(code, expected)| code != expected).count()
}

/// Builds the report from the measured figures; `machines` are in the order of [`MACHINES`].
fn report(
    inputs: &Inputs<Plane>,
    machines: &[(Counts, Loops)],
    flash_bytes: usize,
) -> Result<Report, Failure> {
    let blamed = |is_faulty: fn(&Counts) -> bool| {
        let blamed = machines.iter().filter(|(counts, _)| is_faulty(counts));
        let names: Vec<&str> = blamed.map(|(counts, _)| counts.machine.name).collect();
        names.join(", ")
    };
    let cycles = |machine: usize, rest, iteration: fn(&LoopCycles) -> Option<f64>| {
        let (counts, loops) = machines.get(machine)?;
        loops.per_code(counts.per_code(), rest, iteration)
    };
    let m4 = cycles(0, REST_M4, |each| each.arm_table.map(f64::from));
    let m4_mca = cycles(0, REST_M4, |each| each.llvm_mca);
    let m7 = cycles(1, REST_M7, |each| each.llvm_mca);
    let load = |cycles: Option<f64>, mhz| cycles.map(|cycles| load_percent(cycles, mhz));

    let next = "compare with `git log` of int8-nn, pipeline, model and the toolchain";
    let mut report = Report::new("encoder", next);
    // The Cortex-M4F has the limits. The kernels for the Cortex-M7 take more instructions, so that it can issue two
    // at once.
    for (name, unit, value) in machines[0].0.figures() {
        report.figure(name, unit, value);
    }
    // The cycles include the shortcut, and assume code and data in memory without wait states.
    report.optional("cycles_per_code_m4", "cycles", m4);
    report.optional("cycles_per_code_m4_llvm_mca", "cycles", m4_mca);
    report.optional("cycles_per_code_m7", "cycles", m7);
    report.optional("load_168_mhz_percent", "%", load(m4, 168.0));
    report.optional("load_480_mhz_percent", "%", load(m7, 480.0));
    report.flag("constant_count", blamed(|counts| !counts.is_constant()));
    let ram_bytes = machines.iter().map(|(counts, _)| counts.ram).max();
    let ram_bytes = ram_bytes.unwrap_or(u32::MAX);
    report.figure("ram_bytes", "bytes", ram_bytes);
    report.figure("flash_bytes", "bytes", flash_bytes);
    add_parts(&mut report, flash_bytes, ram_bytes)?;
    report.flag("bytes_equal", blamed(|counts| counts.different > 0));
    let steps = inputs.data.iter().map(Vec::len);
    let windows: usize = steps.map(hop::windows).sum();
    report.figure("windows", "per machine", windows);
    report.detail("machines", machines.iter().map(json).collect::<Json>());
    report.detail("inputs", inputs.names.clone());
    report.detail("skipped", inputs.skipped.clone());
    report.detail("counted_elsewhere", checked_in::published("encoder")?);
    Ok(report)
}

/// Adds the flash and RAM that acquisition and encoder leave free on each microcontroller.
fn add_parts(report: &mut Report, flash_bytes: usize, ram_bytes: u32) -> Result<(), Failure> {
    let mut rooms = Vec::new();
    for part in checked_in::parts()? {
        let flash_left = part.flash_kib * 1024 - i64::try_from(flash_bytes).unwrap_or(i64::MAX);
        let ram_left = part.ram_kib * 1024 - i64::from(ram_bytes);
        report.part_figure(&part.name, "flash_left", flash_left);
        report.part_figure(&part.name, "ram_left", ram_left);
        rooms.push(json!({
            "part": part.name,
            "region": part.region,
            "flash_left": flash_left,
            "ram_left": ram_left,
        }));
    }
    report.detail("rooms", rooms);
    Ok(())
}

fn json((counts, loops): &(Counts, Loops)) -> Json {
    let kernels = counts.kernels.iter();
    let kernels = kernels.map(|(name, count)| json!({ "name": name, "insn_per_code": count }));
    let steps: [[u32; 2]; HOP] = std::array::from_fn(|place| counts.steps.range(place));
    let mut machine = json!({
        "machine": counts.machine.name,
        "core": counts.machine.core,
        "steps": steps,
        "kernels": kernels.collect::<Json>(),
        "loops": loops.loops,
        "skipped": loops.skipped,
        "rest_per_code": counts.rest_per_code(),
        "acquisition_per_code": counts.acquisition,
        "constant": counts.is_constant(),
        "different_codes": counts.different,
    });
    for (name, _, value) in counts.figures() {
        machine[name] = value;
    }
    machine
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Report of one machine with all figures within their limits.
    fn sound(counts: Counts) -> Report {
        let mut inputs = Inputs::new();
        for name in ["silence", "noise"] {
            inputs.add(name, vec![[0; 90]; hop::steps(12)]);
        }
        let machines = [(counts, Loops::default())];
        let mut report = report(&inputs, &machines, 300_000).expect("a report");
        report.set("worst_over_mean", 1.1);
        report
    }

    fn fault(report: Report) -> String {
        let faults = report.faults();
        assert_eq!(faults.len(), 1, "{faults:?}");
        faults[0].clone()
    }

    #[test]
    fn the_json_is_one_object_with_the_figures() {
        let report = sound(Counts::synthetic());
        let json = report.json();
        for (name, value) in [
            ("insn_per_code", 6_900),
            ("insn_per_code_shortcut", 8_500),
            ("insn_after_last_sample", 1_300),
            ("ram_bytes", 35_000),
            ("flash_bytes", 300_000),
            ("windows", 24),
        ] {
            assert_eq!(json[name], value, "{name}");
        }
        assert_eq!(json["constant_count"], true);
        assert!(json["worst_over_mean"].is_f64());
        assert!(json["cycles_per_code_m4"].is_null());
        assert_eq!(json["rooms"][0]["flash_left"], 512 * 1024 - 300_000);
        assert_eq!(json["machines"][0]["insn_per_code"], 6_900);
        assert_eq!(json["machines"][0]["steps"][7], json!([1500, 1500]));
        let text = report.to_string();
        for words in ["mps2-an386: steps", "STM32F446RE", "not measured"] {
            assert!(text.contains(words), "{text}");
        }
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn a_machine_that_varies_or_differs_is_named() {
        let varying = fault(sound(Counts::varying()));
        let words = "constant_count is false (mps2-an386)";
        assert!(varying.starts_with(words), "{varying}");
        let mut counts = Counts::synthetic();
        counts.different = 1;
        let different = fault(sound(counts));
        let words = "bytes_equal is false (mps2-an386)";
        assert!(different.starts_with(words), "{different}");
    }

    #[test]
    fn a_time_step_that_is_too_long_is_found_in_the_counts() {
        let mut report = sound(Counts::synthetic());
        report.set("worst_over_mean", 1_300.0 * 8.0 / 6_900.0);
        let words = "worst_over_mean is 1.507 times the mean; the limit is at most 1.2";
        assert!(fault(report).starts_with(words));
    }

    #[test]
    fn one_byte_too_many_does_not_fit_the_smallest_part() {
        let faults = |flash_bytes, ram_bytes| {
            let mut report = Report::new("encoder", "");
            add_parts(&mut report, flash_bytes, ram_bytes).expect("parts.toml");
            let mut faults = report.faults();
            faults.retain(|fault| fault.contains("_left of"));
            faults
        };
        assert_eq!(faults(512 * 1024, 128 * 1024), [""; 0]);
        let flash = faults(512 * 1024 + 1, 0);
        assert!(flash[0].starts_with("flash_left of STM32F446RE is -1 bytes"));
        assert_eq!(flash.len(), 1);
        let ram = faults(0, 128 * 1024 + 1);
        assert!(ram[0].starts_with("ram_left of STM32F446RE is -1 bytes"));
        assert_eq!(ram.len(), 2);
    }

    #[test]
    fn a_single_bit_is_a_different_code() {
        let expected = vec![0; 3 * CODE];
        let mut output = expected.clone();
        output[CODE + 5] = 1;
        assert_eq!(different(&expected, &output), 1);
    }
}
