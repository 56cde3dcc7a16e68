//! Instruction counts of the encoder on one emulated machine.

use emulator::Machine;
use model::HOP;
use serde_json::{Value as Json, json};

use crate::hop::COMPLETING;
use crate::kernel::{self, SHORTCUT};
use crate::report::images::{Lines, Tallies};

#[derive(Debug, Clone)]
pub(crate) struct Counts {
    pub(crate) machine: Machine,
    /// Tallies of instructions, with one column for each time step of a hop.
    pub(crate) steps: Tallies,
    /// Name and instructions per code of each kernel.
    pub(crate) kernels: Vec<(&'static str, u32)>,
    /// Number of instructions of the acquisition for all time steps of one code.
    pub(crate) acquisition: u32,
    /// RAM that the state of acquisition and encoder occupies, bytes.
    pub(crate) ram: u32,
    /// Number of codes that differ from those of the PC.
    pub(crate) different: usize,
}

impl Counts {
    /// Reads the lines of a run with `inputs` inputs.
    pub(crate) fn parse(machine: Machine, lines: &[String], inputs: usize) -> Result<Self, String> {
        let mut lines = Lines::parse(lines)?;
        let places: Vec<usize> = (0..HOP).collect();
        let steps = Tallies::remove(&mut lines, "step", inputs, &places)?;
        let mut kernels = Vec::new();
        kernel::each(|kernel, _| kernels.push(kernel));
        let kernels = kernels.into_iter().map(|kernel| {
            let count = lines.number(&format!("kernel {}", kernel.name))?;
            Ok((kernel.name, kernel.per_code * count))
        });
        let kernels = kernels.collect::<Result<_, String>>()?;
        let acquisition = lines.number("acquisition")? * small(HOP);
        let ram = lines.number("ram acquisition")? + lines.number("ram encoder")?;
        lines.finish()?;
        Ok(Self {
            machine,
            steps,
            kernels,
            acquisition,
            ram,
            different: 0,
        })
    }

    /// Returns the number of instructions per code: the sum, over the time steps of a hop, of the
    /// largest count of each.
    pub(crate) fn per_code(&self) -> u32 {
        (0..HOP).map(|place| self.steps.range(place)[1]).sum()
    }

    /// Returns whether each time step takes the same number of instructions for every input.
    pub(crate) fn is_constant(&self) -> bool {
        (0..HOP).all(|place| self.steps.is_constant(place))
    }

    /// Returns name, unit and value of the instruction figures.
    ///
    /// The built-in network has a shortcut. A figure without it is the count with it minus that of the
    /// shortcut's matrix products, counted alone.
    pub(crate) fn figures(&self) -> [(&'static str, &'static str, Json); 6] {
        let per_code = |name| self.kernels.iter().find(|kernel| kernel.0 == name);
        let shortcut = per_code(SHORTCUT).map_or(0, |kernel| kernel.1);
        // The products are spread evenly over the time steps of a hop.
        let in_step = shortcut / small(HOP);
        let (all, last) = (self.per_code(), self.steps.range(COMPLETING)[1]);
        let (without, last_without) = (all.saturating_sub(shortcut), last.saturating_sub(in_step));
        let (insn, mean) = ("instructions", "times the mean");
        [
            ("insn_per_code", insn, json!(without)),
            ("insn_per_code_shortcut", insn, json!(all)),
            ("insn_after_last_sample", insn, json!(last_without)),
            ("insn_after_last_sample_shortcut", insn, json!(last)),
            (
                "worst_over_mean",
                mean,
                json!(self.worst_over_mean(in_step)),
            ),
            (
                "worst_over_mean_shortcut",
                mean,
                json!(self.worst_over_mean(0)),
            ),
        ]
    }

    /// Returns the worst time step over the mean of the best time steps, each minus `left_out` instructions.
    fn worst_over_mean(&self, left_out: u32) -> f64 {
        let step = |place, end: usize| {
            let count: u32 = self.steps.range(place)[end];
            f64::from(count.saturating_sub(left_out))
        };
        let worst = (0..HOP).map(|place| step(place, 1)).fold(0.0, f64::max);
        let sum: f64 = (0..HOP).map(|place| step(place, 0)).sum();
        worst * f64::from(small(HOP)) / sum
    }

    /// Returns the number of instructions per code outside the kernels: requantisation, sums,
    /// reordering.
    pub(crate) fn rest_per_code(&self) -> i64 {
        let in_kernels: u32 = self.kernels.iter().map(|kernel| kernel.1).sum();
        i64::from(self.per_code()) - i64::from(in_kernels)
    }
}

fn small(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use emulator::MACHINES;

    use super::*;

    /// Lines for two inputs: the last time step of a hop takes 1500, all others 1000.
    fn lines() -> Vec<String> {
        let mut lines = vec![
            "ram acquisition 5000".to_owned(),
            "ram encoder 30000".to_owned(),
            "acquisition 900".to_owned(),
        ];
        kernel::each(|kernel, _| lines.push(format!("kernel {} 100", kernel.name)));
        for input in 0..2 {
            for place in 0..HOP {
                let count = if place == HOP - 1 { 1500 } else { 1000 };
                let total = 10 * count;
                lines.push(format!("step {input} {place} {count} {count} {total}"));
            }
        }
        lines
    }

    impl Counts {
        pub(crate) fn synthetic() -> Self {
            Self::parse(MACHINES[0], &lines(), 2).expect("the lines of an image")
        }

        /// The last time step takes one instruction more for the second input.
        pub(crate) fn varying() -> Self {
            let mut lines = lines();
            let line = lines.last_mut().expect("lines");
            *line = format!("step 1 {} 1500 1501 15001", HOP - 1);
            Self::parse(MACHINES[0], &lines, 2).expect("the lines of an image")
        }
    }

    #[test]
    fn one_instruction_more_on_one_input_is_not_constant() {
        assert!(Counts::synthetic().is_constant());
        assert!(!Counts::varying().is_constant());
        assert_eq!(Counts::varying().steps.range(HOP - 1), [1500, 1501]);
    }

    #[test]
    fn the_shortcuts_products_are_subtracted_from_every_time_step() {
        let counts = Counts::synthetic();
        // 7 time steps of 1000 and the last of 1500; the shortcut takes 100 and runs twice in each.
        let expected = [
            ("insn_per_code", json!(8_500 - 16 * 100)),
            ("insn_per_code_shortcut", json!(8_500)),
            ("insn_after_last_sample", json!(1_300)),
            ("insn_after_last_sample_shortcut", json!(1_500)),
            ("worst_over_mean", json!(1_300.0 * 8.0 / 6_900.0)),
            ("worst_over_mean_shortcut", json!(1_500.0 * 8.0 / 8_500.0)),
        ];
        let figures = counts.figures().map(|(name, _, value)| (name, value));
        assert_eq!(figures, expected);
        // Each convolution's three kernels run 8 times, the fully connected layer 6, the shortcut 16 times.
        assert_eq!(counts.kernels.last(), Some(&(SHORTCUT, 16 * 100)));
        assert_eq!(counts.rest_per_code(), 8_500 - 100 * (3 * 8 + 6 + 16));
        assert_eq!((counts.acquisition, counts.ram), (7_200, 35_000));
    }

    #[test]
    fn an_image_that_prints_something_else_is_refused() {
        for line in ["step 2 0 1 1 1", "step 0 8 1 1 1", "kernel theirs 100"] {
            let lines = [lines(), vec![line.to_owned()]].concat();
            let why = Counts::parse(MACHINES[0], &lines, 2).expect_err("broken");
            assert_eq!(why, format!("unknown: {line:?}"));
        }
        for (place, words) in [
            (0, "ram acquisition"),
            (2, "acquisition"),
            (3, "kernel conv1"),
        ] {
            let mut lines = lines();
            lines.remove(place);
            let why = Counts::parse(MACHINES[0], &lines, 2).expect_err("broken");
            assert_eq!(why, format!("a line is missing: {words:?}"));
        }
    }
}
