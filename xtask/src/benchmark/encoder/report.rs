//! The encoder's figures, and their limits.

mod table;

use bench::hop::{COMPLETING, OPEN_WINDOWS};
use bench::kernel;
use model::HOP;
use serde::Serialize;

use super::counts::Counts;
use super::cycles::{Estimate, Loops};
use super::elsewhere::{ELSEWHERE, Elsewhere};
use super::inputs::Inputs;
use super::part::Room;
use crate::failure::Failure;

/// Most instructions per code without the shortcut: measured 1,098,561.
const MOST_PER_CODE: u32 = 1_100_000;
/// The same with the shortcut: measured 1,227,377.
const MOST_WITH_SHORTCUT: u32 = 1_230_000;
/// Most instructions from a window's last step to its code, without the shortcut: measured 146,637.
const MOST_AFTER_LAST: u32 = 148_000;
/// Most that the worst step may exceed the mean step.
const WORST_OVER_MEAN: f64 = 1.2;
/// Most bytes of state, acquisition and encoder.
const MOST_RAM: u32 = 48_000;
/// Most bytes of flash.
const MOST_FLASH: usize = 400_000;

/// Everything that was counted; the object of `--json`.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// Those of the Cortex-M4F, whose kernels take the fewest instructions. A Cortex-M7 issues two at
    /// once, and its kernels take more of them to make use of it.
    #[serde(flatten)]
    instructions: Instructions,
    #[serde(flatten)]
    cycles: Estimate,
    /// Whether every step takes as many instructions for every input, on both machines.
    constant_count: bool,
    /// Bytes of the acquisition's and the encoder's state.
    ram_bytes: u32,
    /// Bytes of the larger of both images that hold acquisition, encoder and weights alone.
    flash_bytes: usize,
    /// What is left of microcontrollers.
    rooms: Vec<Room>,
    /// Whether both machines' codes are the PC's.
    bytes_equal: bool,
    /// Windows whose codes were compared, on each machine.
    windows: usize,
    machines: Vec<MachineFigures>,
    inputs: Vec<&'static str>,
    skipped: Vec<String>,
    counted_elsewhere: [Elsewhere; ELSEWHERE.len()],
    faults: Vec<String>,
}

/// What a machine takes. "Without the shortcut" is the count with it, as the built-in network runs,
/// less that of its matrix products, counted alone.
#[derive(Debug, Clone, Copy, Serialize)]
struct Instructions {
    /// All steps of a hop, each its worst, without the shortcut.
    insn_per_code: u32,
    /// The same with it.
    insn_per_code_shortcut: u32,
    /// The step that completes a window, without the shortcut.
    insn_after_last_sample: u32,
    /// The same with it.
    insn_after_last_sample_shortcut: u32,
    /// The worst step over the mean of a hop, without the shortcut.
    worst_over_mean: f64,
    /// The same with it.
    worst_over_mean_shortcut: f64,
}

#[derive(Debug, Clone, Serialize)]
struct MachineFigures {
    machine: &'static str,
    core: &'static str,
    #[serde(flatten)]
    instructions: Instructions,
    /// Fewest and most instructions of each step of a hop.
    steps: [[u32; 2]; HOP],
    /// The kernels, each alone.
    kernels: Vec<KernelFigures>,
    /// The kernels' inner loops, in cycles.
    #[serde(flatten)]
    loops: Loops,
    /// What the steps take beside the kernels: requantisation, sums, order.
    rest_per_code: i64,
    /// The acquisition's share, eight steps of four samples.
    acquisition_per_code: u32,
    constant: bool,
    different_codes: usize,
}

#[derive(Debug, Clone, Serialize)]
struct KernelFigures {
    name: &'static str,
    insn_per_code: u32,
}

impl Report {
    /// Puts the figures together and judges them; the first machine is the one whose instructions
    /// have limits.
    ///
    /// # Panics
    /// When there is no machine.
    pub(crate) fn new(
        inputs: &Inputs,
        counts: &[Counts],
        loops: &[Loops],
        flash_bytes: usize,
    ) -> Self {
        let machines = counts.iter().zip(loops);
        let cycles = machines
            .clone()
            .map(|(counts, loops)| (counts.machine, loops, per_code(counts)));
        let machines: Vec<MachineFigures> = machines
            .map(|(counts, loops)| MachineFigures::of(counts, loops))
            .collect();
        let rams = counts.iter().map(|counts| counts.ram.iter().sum());
        let ram_bytes = rams.max().unwrap_or(u32::MAX);
        let mut report = Self {
            instructions: machines[0].instructions,
            cycles: Estimate::of(cycles),
            constant_count: counts.iter().all(Counts::is_constant),
            ram_bytes,
            flash_bytes,
            rooms: Room::in_parts(flash_bytes, ram_bytes).to_vec(),
            bytes_equal: counts.iter().all(|counts| counts.different == 0),
            windows: inputs.windows * inputs.names.len(),
            machines,
            inputs: inputs.names.clone(),
            skipped: inputs.skipped.clone(),
            counted_elsewhere: ELSEWHERE,
            faults: Vec::new(),
        };
        report.faults = report.find_faults();
        report
    }

    /// One object.
    pub(crate) fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}"))
    }

    /// Whether all limits are kept.
    ///
    /// # Errors
    /// Names those that are not.
    pub(crate) fn judge(&self) -> Result<(), Failure> {
        if self.faults.is_empty() {
            return Ok(());
        }
        Err(Failure::Check {
            what: "the encoder's benchmark".to_owned(),
            why: self.faults.join("; "),
            next: "compare with `git log` of int8-nn, pipeline, model and the toolchain".to_owned(),
        })
    }

    /// A ratio that is no number keeps no limit.
    fn find_faults(&self) -> Vec<String> {
        let counts = &self.instructions;
        let limits = [
            ("insn_per_code", counts.insn_per_code, MOST_PER_CODE),
            (
                "insn_per_code_shortcut",
                counts.insn_per_code_shortcut,
                MOST_WITH_SHORTCUT,
            ),
            (
                "insn_after_last_sample",
                counts.insn_after_last_sample,
                MOST_AFTER_LAST,
            ),
            ("ram_bytes", self.ram_bytes, MOST_RAM),
        ];
        let mut faults: Vec<String> = limits
            .iter()
            .filter(|(_, figure, most)| figure > most)
            .map(|(name, figure, most)| format!("{name} is {figure}, {most} allowed"))
            .collect();
        let (flash, ratio) = (self.flash_bytes, counts.worst_over_mean);
        let checks = [
            (
                flash <= MOST_FLASH,
                format!("flash_bytes is {flash}, {MOST_FLASH} allowed"),
            ),
            (
                ratio <= WORST_OVER_MEAN,
                format!("worst_over_mean is {ratio:.3}, {WORST_OVER_MEAN} allowed"),
            ),
            (
                self.constant_count,
                format!(
                    "constant_count: the number of instructions depends on the input on {}",
                    self.blamed(|machine| !machine.constant)
                ),
            ),
            (
                self.bytes_equal,
                format!(
                    "bytes_equal: the codes are not the PC's on {}",
                    self.blamed(|machine| machine.different_codes > 0)
                ),
            ),
        ];
        let broken = checks.into_iter().filter(|(kept, _)| !kept);
        faults.extend(broken.map(|(_, words)| words));
        faults.extend(self.rooms.iter().filter_map(Room::fault));
        faults
    }

    fn blamed(&self, faulty: fn(&MachineFigures) -> bool) -> String {
        let blamed = self.machines.iter().filter(|machine| faulty(machine));
        let names: Vec<&str> = blamed.map(|machine| machine.machine).collect();
        names.join(", ")
    }
}

impl MachineFigures {
    fn of(counts: &Counts, loops: &Loops) -> Self {
        let mut kernels = Vec::new();
        let mut runs = counts.kernels.iter();
        kernel::each(|kernel, _| {
            kernels.push(KernelFigures {
                name: kernel.name,
                insn_per_code: kernel.per_code * runs.next().copied().unwrap_or(0),
            });
        });
        let in_kernels: u32 = kernels.iter().map(|kernel| kernel.insn_per_code).sum();
        Self {
            machine: counts.machine.name,
            core: counts.machine.core,
            instructions: Instructions::of(counts),
            steps: std::array::from_fn(|place| counts.step(place)),
            kernels,
            loops: loops.clone(),
            rest_per_code: i64::from(per_code(counts)) - i64::from(in_kernels),
            acquisition_per_code: counts.acquisition * steps(),
            constant: counts.is_constant(),
            different_codes: counts.different,
        }
    }
}

impl Instructions {
    fn of(counts: &Counts) -> Self {
        let (all, last) = (per_code(counts), counts.step(COMPLETING)[1]);
        let shortcut = shortcut_per_step(counts);
        Self {
            insn_per_code: all.saturating_sub(shortcut * steps()),
            insn_per_code_shortcut: all,
            insn_after_last_sample: last.saturating_sub(shortcut),
            insn_after_last_sample_shortcut: last,
            worst_over_mean: counts.worst_over_mean(shortcut),
            worst_over_mean_shortcut: counts.worst_over_mean(0),
        }
    }
}

/// Steps of a hop.
fn steps() -> u32 {
    u32::try_from(HOP).unwrap_or(u32::MAX)
}

/// The worst of each step of a hop.
fn per_code(counts: &Counts) -> u32 {
    (0..HOP).map(|place| counts.step(place)[1]).sum()
}

/// A step belongs to so many windows, and the shortcut runs for each.
fn shortcut_per_step(counts: &Counts) -> u32 {
    counts.shortcut() * u32::try_from(OPEN_WINDOWS).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::super::counts::tests::{counts, said};
    use super::*;

    type Break = fn(&mut Report);

    pub(super) fn report() -> Report {
        let inputs = Inputs {
            names: vec!["silence", "noise"],
            planes: Vec::new(),
            windows: 12,
            skipped: Vec::new(),
        };
        Report::new(&inputs, &[counts(&said())], &[Loops::default()], 300_000)
    }

    #[test]
    fn the_shortcut_s_products_are_taken_off_every_step() {
        let report = report();
        // 7 steps of 1000 and the last of 1500; a run of the shortcut takes 100, a step has two.
        assert_eq!(report.instructions.insn_per_code_shortcut, 8_500);
        assert_eq!(report.instructions.insn_per_code, 8_500 - 16 * 100);
        assert_eq!(report.instructions.insn_after_last_sample_shortcut, 1_500);
        assert_eq!(report.instructions.insn_after_last_sample, 1_300);
        assert!(
            (report.instructions.worst_over_mean_shortcut - 1_500.0 * 8.0 / 8_500.0).abs() < 1e-12
        );
        assert!((report.instructions.worst_over_mean - 1_300.0 * 8.0 / 6_900.0).abs() < 1e-12);
        assert_eq!(report.ram_bytes, 35_000);
        // 8 of each convolution's three kernels, 6 of the fully connected, 16 of the shortcut.
        assert_eq!(
            report.machines[0].rest_per_code,
            8_500 - 100 * (3 * 8 + 6 + 16)
        );
        assert_eq!(report.machines[0].acquisition_per_code, 7_200);
    }

    #[test]
    fn every_limit_is_judged_and_named() {
        let sound = || {
            let mut report = report();
            report.instructions.worst_over_mean = 1.1;
            report
        };
        assert!(sound().find_faults().is_empty());
        let broken: [(Break, &str); 10] = [
            (
                |report| report.instructions.insn_per_code = 1_300_001,
                "insn_per_code is 1300001",
            ),
            (
                |report| report.instructions.insn_per_code_shortcut = 1_450_001,
                "insn_per_code_shortcut is 1450001",
            ),
            (
                |report| report.instructions.insn_after_last_sample = 152_001,
                "insn_after_last_sample is 152001",
            ),
            (
                |report| report.instructions.worst_over_mean = 1.21,
                "worst_over_mean is 1.210",
            ),
            (
                |report| report.instructions.worst_over_mean = f64::NAN,
                "worst_over_mean is NaN",
            ),
            (|report| report.ram_bytes = 48_001, "ram_bytes is 48001"),
            (
                |report| report.flash_bytes = 400_001,
                "flash_bytes is 400001",
            ),
            (
                |report| report.rooms[0].ram_left = -1,
                "STM32F446RE has too little",
            ),
            (
                |report| {
                    report.constant_count = false;
                    report.machines[0].constant = false;
                },
                "constant_count: the number of instructions depends on the input on mps2-an386",
            ),
            (
                |report| {
                    report.bytes_equal = false;
                    report.machines[0].different_codes = 1;
                },
                "bytes_equal: the codes are not the PC's on mps2-an386",
            ),
        ];
        for (break_it, words) in broken {
            let mut report = sound();
            break_it(&mut report);
            report.faults = report.find_faults();
            let failure = report.judge().expect_err("a limit is broken");
            assert!(failure.to_string().contains(words), "{failure}");
            assert_eq!(report.faults.len(), 1);
        }
    }

    #[test]
    fn a_worst_step_that_is_too_long_is_found_in_the_counts() {
        assert_eq!(report().faults, ["worst_over_mean is 1.507, 1.2 allowed"]);
    }

    #[test]
    fn the_json_is_one_object_with_the_figures() {
        let json: serde_json::Value = serde_json::from_str(&report().json()).expect("JSON");
        assert_eq!(json["insn_per_code"], 6_900);
        assert_eq!(json["insn_per_code_shortcut"], 8_500);
        assert_eq!(json["insn_after_last_sample"], 1_300);
        assert_eq!(json["constant_count"], true);
        assert_eq!(json["ram_bytes"], 35_000);
        assert_eq!(json["flash_bytes"], 300_000);
        assert!(json["worst_over_mean"].is_f64());
        assert!(json["cycles_per_code_m4"].is_null());
        assert_eq!(json["rooms"][0]["flash_left"], 512 * 1024 - 300_000);
        assert_eq!(json["machines"][0]["insn_per_code"], 6_900);
        assert!(!report().json().contains('\n'));
    }
}
