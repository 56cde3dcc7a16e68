//! Counts of the encoder on one machine, and whether its codes are those of the PC.

use emulator::Machine;
use model::{CODE, HOP};

use crate::hop::{COMPLETING, OPEN_WINDOWS};
use crate::kernel::{self, Kernel, SHORTCUT};
use crate::report::failure::Failure;
use crate::report::images::{Counts, Output, mismatch};
use crate::report::value::Value;
use crate::tally::Tally;

/// Counts and comparison of one machine.
#[derive(Debug, Clone)]
pub(crate) struct Tallies {
    pub(crate) machine: Machine,
    /// Per input and place in the hop.
    steps: Vec<[Tally; HOP]>,
    /// Kernels with the instructions of one run.
    kernels: Vec<(Kernel, u32)>,
    /// Instructions of the acquisition for one time step.
    acquisition: u32,
    /// State of acquisition and encoder, bytes.
    pub(crate) ram: u32,
    /// Codes that differ from those of the PC.
    pub(crate) different: usize,
}

impl Tallies {
    /// Reads the output of a run with `inputs` inputs.
    ///
    /// # Errors
    /// Lines or bytes are missing, or there are too many.
    pub(crate) fn new(
        machine: Machine,
        output: Output,
        inputs: usize,
        expected: &[u8],
    ) -> Result<Self, Failure> {
        let (length, wanted) = (output.bytes.len(), expected.len());
        if length != wanted {
            let why = format!("the output has {length} bytes, {wanted} expected");
            return Err(mismatch(machine, why));
        }
        let tallies = Self::parse(machine, output.counts, inputs);
        let tallies = tallies.map_err(|why| mismatch(machine, why))?;
        let codes = output.bytes.chunks(CODE).zip(expected.chunks(CODE));
        Ok(Self {
            different: codes.filter(|(code, expected)| code != expected).count(),
            ..tallies
        })
    }

    fn parse(machine: Machine, mut counts: Counts, inputs: usize) -> Result<Self, String> {
        let mut steps = vec![[Tally::EMPTY; HOP]; inputs];
        for (input, tallies) in steps.iter_mut().enumerate() {
            for (place, tally) in tallies.iter_mut().enumerate() {
                *tally = counts.tally(&format!("step {input} {place}"))?;
            }
        }
        let mut kernels = Vec::new();
        for kernel in kernels_in_order() {
            let count = counts.number(&format!("kernel {}", kernel.name))?;
            kernels.push((kernel, count));
        }
        let tallies = Self {
            machine,
            steps,
            kernels,
            acquisition: counts.number("acquisition")?,
            ram: counts.number("ram acquisition")? + counts.number("ram encoder")?,
            different: 0,
        };
        counts.finish()?;
        Ok(tallies)
    }

    /// Returns the fewest and the most instructions of the time step at a place in the hop, over all inputs.
    pub(crate) fn step(&self, place: usize) -> [u32; 2] {
        let tallies = || self.steps.iter().map(|places| places[place]);
        let fewest = tallies().map(|tally| tally.fewest).min();
        let most = tallies().map(|tally| tally.most).max();
        [fewest.unwrap_or(0), most.unwrap_or(u32::MAX)]
    }

    /// Returns the instructions of a code: each time step of a hop at its most.
    pub(crate) fn per_code(&self) -> u32 {
        (0..HOP).map(|place| self.step(place)[1]).sum()
    }

    /// Returns name and instructions per code of each kernel.
    pub(crate) fn kernels(&self) -> impl Iterator<Item = (&'static str, u32)> {
        let kernels = self.kernels.iter();
        kernels.map(|(kernel, count)| (kernel.name, kernel.per_code * count))
    }

    /// Returns the instructions per code outside the kernels: requantisation, sums, order.
    pub(crate) fn rest_per_code(&self) -> i64 {
        let in_kernels: u32 = self.kernels().map(|(_, count)| count).sum();
        i64::from(self.per_code()) - i64::from(in_kernels)
    }

    /// Returns the instructions of the acquisition for the time steps of a code.
    pub(crate) fn acquisition_per_code(&self) -> u32 {
        self.acquisition * small(HOP)
    }

    /// Returns name, unit and value of the instruction figures.
    ///
    /// The built-in network has a shortcut. A figure without it is the count with it minus that of the
    /// shortcut's matrix products, counted alone.
    pub(crate) fn figures(&self) -> [(&'static str, &'static str, Value); 6] {
        let shortcut = self.kernels.iter().find(|(kernel, _)| kernel.name == SHORTCUT);
        // Each time step belongs to several windows, and the shortcut runs for each of them.
        let shortcut = shortcut.map_or(0, |(_, count)| count * small(OPEN_WINDOWS));
        let (all, last) = (self.per_code(), self.step(COMPLETING)[1]);
        let without = all.saturating_sub(shortcut * small(HOP));
        let unit = "instructions";
        [
            ("insn_per_code", unit, without.into()),
            ("insn_per_code_shortcut", unit, all.into()),
            (
                "insn_after_last_sample",
                unit,
                last.saturating_sub(shortcut).into(),
            ),
            ("insn_after_last_sample_shortcut", unit, last.into()),
            (
                "worst_over_mean",
                "times the mean",
                self.worst_over_mean(shortcut).into(),
            ),
            (
                "worst_over_mean_shortcut",
                "times the mean",
                self.worst_over_mean(0).into(),
            ),
        ]
    }

    /// Returns the worst time step over the mean of the best ones, each minus `left_out` instructions.
    fn worst_over_mean(&self, left_out: u32) -> f64 {
        let step = |place, end: usize| f64::from(self.step(place)[end].saturating_sub(left_out));
        let worst = (0..HOP).map(|place| step(place, 1)).fold(0.0, f64::max);
        let sum: f64 = (0..HOP).map(|place| step(place, 0)).sum();
        worst * f64::from(small(HOP)) / sum
    }

    /// Whether each time step takes the same number of instructions for every input.
    ///
    /// The time steps of different hops can differ: the position in a ring buffer can affect the count, its
    /// contents must not.
    pub(crate) fn is_constant(&self) -> bool {
        self.steps.iter().all(|tallies| *tallies == self.steps[0])
    }
}

fn kernels_in_order() -> Vec<Kernel> {
    let mut kernels = Vec::new();
    kernel::each(|kernel, _| kernels.push(kernel));
    kernels
}

fn small(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

#[cfg(test)]
pub(crate) mod tests {
    use emulator::MACHINES;

    use super::*;

    /// Lines for two inputs: the last time step of a hop takes 1500, all others 1000.
    fn lines() -> Vec<String> {
        let mut lines = vec![
            "ram acquisition 5000".to_owned(),
            "ram encoder 30000".to_owned(),
            "acquisition 900".to_owned(),
        ];
        let kernels = kernels_in_order().into_iter();
        lines.extend(kernels.map(|kernel| format!("kernel {} 100", kernel.name)));
        for input in 0..2 {
            for place in 0..HOP {
                let count = if place == HOP - 1 { 1500 } else { 1000 };
                let total = 10 * count;
                lines.push(format!("step {input} {place} {count} {count} {total}"));
            }
        }
        lines
    }

    fn parsed(lines: &[String]) -> Result<Tallies, String> {
        Tallies::parse(MACHINES[0], Counts::parse(lines)?, 2)
    }

    pub(crate) fn sound() -> Tallies {
        parsed(&lines()).expect("the lines of an image")
    }

    /// Tallies whose last time step takes one instruction more for the second input.
    pub(crate) fn varying() -> Tallies {
        let mut lines = lines();
        let line = lines.last_mut().expect("lines");
        *line = format!("step 1 {} 1500 1501 15001", HOP - 1);
        parsed(&lines).expect("the lines of an image")
    }

    #[test]
    fn counts_are_read_in_any_order() {
        let mut lines = lines();
        lines.reverse();
        let tallies = parsed(&lines).expect("the lines");
        assert_eq!(
            [tallies.step(0), tallies.step(HOP - 1)],
            [[1000; 2], [1500; 2]]
        );
        assert_eq!(tallies.kernels().last(), Some((SHORTCUT, 16 * 100)));
        assert_eq!((tallies.acquisition, tallies.ram), (900, 35_000));
        assert!(tallies.is_constant());
    }

    #[test]
    fn one_instruction_more_on_one_input_is_not_constant() {
        assert!(!varying().is_constant());
        assert_eq!(varying().step(HOP - 1), [1500, 1501]);
    }

    #[test]
    fn the_shortcuts_products_are_subtracted_from_every_time_step() {
        let tallies = sound();
        // 7 time steps of 1000 and the last of 1500; the shortcut takes 100 and runs twice in each.
        let figures = tallies.figures().map(|(name, _, value)| (name, value));
        assert_eq!(
            figures,
            [
                ("insn_per_code", (8_500_u32 - 16 * 100).into()),
                ("insn_per_code_shortcut", 8_500_u32.into()),
                ("insn_after_last_sample", 1_300_u32.into()),
                ("insn_after_last_sample_shortcut", 1_500_u32.into()),
                ("worst_over_mean", (1_300.0 * 8.0 / 6_900.0).into()),
                ("worst_over_mean_shortcut", (1_500.0 * 8.0 / 8_500.0).into()),
            ]
        );
        // Each convolution's three kernels run 8 times, the fully connected layer 6, the shortcut 16 times.
        assert_eq!(tallies.rest_per_code(), 8_500 - 100 * (3 * 8 + 6 + 16));
        assert_eq!(tallies.acquisition_per_code(), 7_200);
    }

    #[test]
    fn an_image_that_prints_something_else_is_refused() {
        for (line, words) in [
            ("step 2 0 1 1 1", "step 2 0"),
            ("step 0 8 1 1 1", "step 0 8"),
            ("step 0 0 1 1 1", "came twice"),
            ("kernel theirs 100", "theirs"),
            ("panicked at", "panicked at"),
        ] {
            let mut lines = lines();
            lines.push(line.to_owned());
            let why = parsed(&lines).expect_err("broken");
            assert!(why.contains(words), "{why}");
        }
        for place in [0, 2, 3, lines().len() - 1] {
            let mut lines = lines();
            lines.remove(place);
            let why = parsed(&lines).expect_err("broken");
            assert!(why.starts_with("a line is missing"), "{why}");
        }
    }

    #[test]
    fn a_single_bit_is_a_different_code_and_a_missing_code_is_refused() {
        let expected = vec![0; 3 * CODE];
        let mut bytes = expected.clone();
        bytes[CODE + 5] = 1;
        let read = |bytes: &[u8]| {
            let output = Output {
                counts: Counts::parse(&lines()).expect("the lines"),
                bytes: bytes.to_vec(),
            };
            Tallies::new(MACHINES[0], output, 2, &expected)
        };
        assert_eq!(read(&bytes).expect("tallies").different, 1);
        assert!(read(&bytes[CODE..]).is_err());
    }
}
