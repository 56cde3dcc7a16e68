//! The benchmark `encoder`: counts the instructions of each time step, measures memory, and
//! compares the codes with the PC's.

mod counts;
mod cycles;

use emulator::{Image, MACHINES, Machine};
use model::CODE_FORMAT;
use pipeline::{CodeValues, Encoder, Plane, Step};
use serde_json::json;

use self::counts::{Counts, Printed};
use self::cycles::{LoopCycles, REST_M4, REST_M7, load_percent};
use super::figures::Report;
use super::images;
use super::inputs::{self, Inputs};
use crate::hop;

/// Encodes at least `windows` windows on each emulated machine, and returns the report.
///
/// # Errors
/// QEMU or the target is missing, an image does not build or run, or an input cannot be made.
pub(crate) fn measure(windows: usize) -> anyhow::Result<Report> {
    let inputs = inputs::planes(windows)?;
    let cells = inputs.data.iter().flatten().flatten().copied();
    let steps = inputs.data.first().map_or(0, Vec::len);
    let expected = Expected::new(steps, cells, codes(&inputs), CODE_FORMAT.bytes());
    let mut machines = Vec::new();
    let mut flash_bytes = 0;
    for machine in MACHINES {
        let bare = Image::build("bench", "size", machine.features)?;
        flash_bytes = images::loaded(bare.path())?.len().max(flash_bytes);
        let tasks = Image::build("bench", "tasks", machine.features)?;
        images::check_panics(&images::loaded(tasks.path())?)?;
        let image = Image::build("bench", "encoder", machine.features)?;
        let (printed, different) = expected.run(&image, machine, "bench/encoder")?;
        let mut counts = Counts::new(machine, printed, different)?;
        match cycles::loops(machine, &image) {
            Ok(loops) => counts.loops = loops,
            Err(why) => {
                let reason = format!("cycles of the {}: {why:#}", machine.core);
                eprintln!("SKIPPED: {reason}");
                counts.skipped.push(reason);
            }
        }
        machines.push(counts);
    }
    report(&inputs, &machines, flash_bytes)
}

/// Input file of the image `encoder`, and the expected contents of its output file.
#[derive(Debug)]
pub(crate) struct Expected {
    input: Vec<u8>,
    /// Codes of all inputs, one after the other, as bytes.
    codes: Vec<u8>,
    /// Length of one code, bytes.
    code_bytes: usize,
}

impl Expected {
    /// Creates the input file from the `cells` of all inputs, which have `steps` time steps each.
    /// Stores the expected `codes`, which have `code_bytes` bytes each.
    pub(crate) fn new(
        steps: usize,
        cells: impl Iterator<Item = i8>,
        codes: Vec<u8>,
        code_bytes: usize,
    ) -> Self {
        Self { input: images::with_steps(steps, cells.map(i8::cast_unsigned)), codes, code_bytes }
    }

    /// Runs the image on the machine. Returns the instruction counts that the image prints, and the
    /// number of codes that differ from the expected codes.
    ///
    /// # Errors
    /// The image does not run to its end, or its outputs are incomplete.
    pub(crate) fn run(
        &self,
        image: &Image,
        machine: Machine,
        folder: &str,
    ) -> anyhow::Result<(Printed, usize)> {
        let length = self.codes.len();
        let (printed, output) = images::run(image, machine, folder, &self.input, length)?;
        let different = images::different(&self.codes, &output, self.code_bytes);
        Ok((printed, different))
    }
}

/// Returns the codes that this PC computes. Each input starts with a new encoder.
fn codes(inputs: &Inputs<Plane>) -> Vec<u8> {
    let mut codes = Vec::new();
    for planes in &inputs.data {
        let mut encoder = Encoder::new();
        for &plane in planes {
            let step = Step { plane, ..Step::default() };
            if let Some(code) = encoder.encode_step(&step) {
                codes.extend(code.values.to_bytes(&mut [0; CodeValues::MAX_BYTES]));
            }
        }
    }
    codes
}

/// Builds the report from the measured figures; `machines` are in the order of [`MACHINES`].
fn report(
    inputs: &Inputs<Plane>,
    machines: &[Counts],
    flash_bytes: usize,
) -> anyhow::Result<Report> {
    let cycles = |machine: usize, rest, iteration: fn(&LoopCycles) -> Option<f64>| {
        let counts = machines.get(machine)?;
        let instructions = counts.figures.insn_per_code_shortcut;
        cycles::per_code(&counts.loops, instructions, rest, iteration)
    };
    let m4 = cycles(0, REST_M4, |each| each.arm_table.map(f64::from));
    let m7 = cycles(1, REST_M7, |each| Some(each.llvm_mca));
    let ram_bytes = machines.iter().map(|counts| counts.ram_bytes).max();
    let ram_bytes = ram_bytes.unwrap_or(u32::MAX);
    let steps = inputs.data.iter().map(Vec::len);
    let mut figures = json!({
        // These cycles include the shortcut, and assume memory without wait states.
        "cycles_per_code_m4": m4,
        "cycles_per_code_m4_llvm_mca": cycles(0, REST_M4, |each| Some(each.llvm_mca)),
        "cycles_per_code_m7": m7,
        "load_168_mhz_percent": m4.map(|cycles| load_percent(cycles, 168.0)),
        "load_480_mhz_percent": m7.map(|cycles| load_percent(cycles, 480.0)),
        "constant_count": machines.iter().all(|counts| counts.constant),
        "bytes_equal": machines.iter().all(|counts| counts.different_codes == 0),
        "ram_bytes": ram_bytes,
        "flash_bytes": flash_bytes,
        // Number of windows that each machine encodes, over all inputs.
        "windows": steps.map(hop::windows).sum::<usize>(),
        "machines": machines,
        "inputs": inputs.names,
        "skipped": inputs.skipped,
    });
    // The limits apply to the Cortex-M4F. The kernels for the Cortex-M7 have more instructions,
    // which that processor can issue in pairs.
    for (name, figure) in json!(machines[0].figures).as_object().into_iter().flatten() {
        figures[name] = figure.clone();
    }
    let next =
        "see `machines`; compare with `git log` of int8-nn, pipeline, model and the toolchain";
    Report::new("encoder", figures, next)
}

#[cfg(test)]
mod tests {
    use model::{CELLS, HOP};

    use super::*;

    /// Returns a report on one machine, whose counts `change` alters. The last time step of a hop
    /// takes `last` instructions, every other step 1000.
    fn report_of(last: u32, change: fn(&mut Counts)) -> Report {
        let mut inputs = Inputs::new();
        for name in ["silence", "noise"] {
            inputs.names.push(name);
            inputs.data.push(vec![[0; CELLS]; hop::steps(12)]);
        }
        let mut counts = Counts::synthetic(last);
        change(&mut counts);
        report(&inputs, &[counts], 300_000).expect("a report")
    }

    impl Expected {
        /// Asserts that this PC's pipeline computes the expected `windows` codes from the input
        /// file.
        pub(crate) fn assert_codes_of_pipeline(&self, windows: usize) {
            let (steps, cells) = self.input.split_first_chunk().expect("a number of steps");
            let planes = cells.as_chunks::<CELLS>().0.iter();
            let planes: Vec<Plane> = planes.map(|plane| plane.map(u8::cast_signed)).collect();
            let mut inputs = Inputs::new();
            for planes in planes.chunks(u32::from_le_bytes(*steps) as usize) {
                inputs.data.push(planes.to_vec());
            }
            assert_eq!(self.codes, codes(&inputs));
            assert_eq!(self.codes.len(), windows * CODE_FORMAT.bytes());
        }
    }

    #[test]
    fn the_json_is_one_object_with_the_figures() {
        let report = report_of(1_100, |_| ());
        let json = &report.object;
        for (name, value) in [
            ("insn_per_code", 1_000 * (HOP - 1) + 1_100 - 1_600),
            ("ram_bytes", 35_000),
            ("flash_bytes", 300_000),
            ("windows", 2 * 12),
        ] {
            assert_eq!(json[name], value, "{name}");
        }
        assert!(json["cycles_per_code_m4"].is_null());
        assert_eq!(json["machines"][0]["insn_per_code"], json["insn_per_code"]);
        assert_eq!(json["machines"][0]["steps"][HOP - 1], json!([1100, 1100]));
        let text = report.to_string();
        for words in ["mps2-an386: steps", "not measured"] {
            assert!(text.contains(words), "{text}");
        }
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn each_fault_is_named() {
        let varying = report_of(1_100, |counts| counts.constant = false);
        let different = report_of(1_100, |counts| counts.different_codes = 1);
        let long = report_of(1_500, |_| ());
        for (report, words) in [
            (varying, "constant_count is false;"),
            (different, "bytes_equal is false;"),
            (long, "worst_over_mean is 1.507; the limit is at most 1.2"),
        ] {
            report.assert_only_fault(words);
        }
    }
}
