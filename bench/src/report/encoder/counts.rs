//! Instruction counts of the encoder on one emulated machine.

use std::collections::BTreeMap;

use anyhow::Context;
use emulator::Machine;
use model::HOP;
use serde::{Deserialize, Serialize};

use super::cycles::LoopCycles;
use crate::hop::COMPLETING;
use crate::kernel::{self, SHORTCUT};
use crate::report::images::Range;
use crate::tally::Tally;

/// What the image prints.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Printed {
    /// State of the acquisition, bytes.
    ram_acquisition: u32,
    /// State of the encoder, bytes.
    ram_encoder: u32,
    /// Instructions of the acquisition for one time step.
    acquisition: u32,
    /// Instructions of one run of each kernel.
    kernels: BTreeMap<String, u32>,
    /// For each input the tallies of the time steps of a hop.
    inputs: Vec<[Tally; HOP]>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Counts {
    pub(crate) machine: &'static str,
    core: &'static str,
    /// Fewest and most instructions of each time step of a hop, over all inputs.
    steps: [[u32; 2]; HOP],
    /// Whether each time step takes the same number of instructions for every input.
    pub(crate) constant: bool,
    kernels: Vec<KernelCount>,
    #[serde(flatten)]
    pub(crate) figures: Figures,
    /// Number of instructions per code outside the kernels: requantisation, sums, reordering.
    rest_per_code: i64,
    /// Number of instructions of the acquisition for all time steps of one code.
    acquisition_per_code: u32,
    /// RAM that the state of acquisition and encoder occupies, bytes.
    #[serde(skip)]
    pub(crate) ram_bytes: u32,
    /// Number of codes that differ from those of the PC.
    pub(crate) different_codes: usize,
    /// Empty if LLVM's tools are missing.
    pub(crate) loops: Vec<LoopCycles>,
    /// Reasons for which figures are left out.
    pub(crate) skipped: Vec<String>,
}

#[derive(Debug, Clone, Serialize)]
struct KernelCount {
    name: &'static str,
    insn_per_code: u32,
}

/// The instruction figures.
///
/// The built-in network has a shortcut. A figure without it is the count with it minus that of the shortcut's matrix
/// products, counted alone; they are spread evenly over the time steps of a hop.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Figures {
    /// Sum, over the time steps of a hop, of the largest count of each.
    insn_per_code: u32,
    pub(crate) insn_per_code_shortcut: u32,
    insn_after_last_sample: u32,
    insn_after_last_sample_shortcut: u32,
    /// Worst time step over the mean of the best time steps.
    worst_over_mean: f64,
    worst_over_mean_shortcut: f64,
}

impl Counts {
    /// Computes the counts from what the image printed; the codes are not compared, and the loops are missing.
    ///
    /// # Errors
    /// The image did not count a kernel.
    pub(crate) fn new(machine: Machine, printed: &Printed) -> anyhow::Result<Self> {
        let steps = Range::of_columns(&printed.inputs);
        let mut kernels = Vec::new();
        kernel::each(|kernel, _| kernels.push(kernel));
        let kernels = kernels.into_iter().map(|kernel| {
            let count = printed.kernels.get(kernel.name);
            let count =
                count.with_context(|| format!("the image did not count {}", kernel.name))?;
            Ok(KernelCount {
                name: kernel.name,
                insn_per_code: kernel.per_code * count,
            })
        });
        let kernels = kernels.collect::<anyhow::Result<Vec<_>>>()?;
        let shortcut = kernels.iter().find(|kernel| kernel.name == SHORTCUT);
        let figures = Figures::new(&steps, shortcut.map_or(0, |kernel| kernel.insn_per_code));
        let in_kernels: u32 = kernels.iter().map(|kernel| kernel.insn_per_code).sum();
        Ok(Self {
            machine: machine.name,
            core: machine.core,
            steps: steps.map(|step| [step.fewest, step.most]),
            constant: steps.iter().all(|step| step.constant),
            rest_per_code: i64::from(figures.insn_per_code_shortcut) - i64::from(in_kernels),
            kernels,
            figures,
            acquisition_per_code: printed.acquisition * small(HOP),
            ram_bytes: printed.ram_acquisition + printed.ram_encoder,
            different_codes: 0,
            loops: Vec::new(),
            skipped: Vec::new(),
        })
    }
}

impl Figures {
    /// Computes the figures from the counts of the time steps; `shortcut` is the shortcut's count per code.
    fn new(steps: &[Range], shortcut: u32) -> Self {
        let in_step = shortcut / small(HOP);
        let all = steps.iter().map(|step| step.most).sum::<u32>();
        let last = steps[COMPLETING].most;
        let worst_over_mean = |left_out| {
            let most = steps.iter().map(|step| step.most.saturating_sub(left_out));
            let fewest = steps
                .iter()
                .map(|step| step.fewest.saturating_sub(left_out));
            let (worst, sum): (u32, u32) = (most.max().unwrap_or(u32::MAX), fewest.sum());
            f64::from(worst) * f64::from(small(HOP)) / f64::from(sum)
        };
        Self {
            insn_per_code: all.saturating_sub(shortcut),
            insn_per_code_shortcut: all,
            insn_after_last_sample: last.saturating_sub(in_step),
            insn_after_last_sample_shortcut: last,
            worst_over_mean: worst_over_mean(in_step),
            worst_over_mean_shortcut: worst_over_mean(0),
        }
    }
}

fn small(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use emulator::MACHINES;

    use super::*;

    impl Counts {
        /// Counts of one input: the last time step of a hop takes `last`, all others 1000 instructions.
        pub(crate) fn synthetic(last: u32) -> Self {
            let mut kernels = BTreeMap::new();
            kernel::each(|kernel, _| _ = kernels.insert(kernel.name.to_owned(), 100));
            let inputs = vec![std::array::from_fn(|place| {
                let mut tally = Tally::EMPTY;
                tally.add(if place == HOP - 1 { last } else { 1000 });
                tally
            })];
            let printed = Printed {
                ram_acquisition: 5_000,
                ram_encoder: 30_000,
                acquisition: 900,
                kernels,
                inputs,
            };
            Self::new(MACHINES[0], &printed).expect("a count of every kernel")
        }
    }

    #[test]
    fn the_shortcuts_products_are_subtracted_from_every_time_step() {
        let counts = Counts::synthetic(1500);
        // 7 time steps of 1000 and the last of 1500; the shortcut takes 100 and runs twice in each.
        let expected = Figures {
            insn_per_code: 8_500 - 16 * 100,
            insn_per_code_shortcut: 8_500,
            insn_after_last_sample: 1_300,
            insn_after_last_sample_shortcut: 1_500,
            worst_over_mean: 1_300.0 * 8.0 / 6_900.0,
            worst_over_mean_shortcut: 1_500.0 * 8.0 / 8_500.0,
        };
        assert_eq!(counts.figures, expected);
        // Each convolution's three kernels run 8 times, the fully connected layer 6, the shortcut 16 times.
        assert_eq!(counts.rest_per_code, 8_500 - 100 * (3 * 8 + 6 + 16));
        assert_eq!(
            (counts.acquisition_per_code, counts.ram_bytes),
            (7_200, 35_000)
        );
    }
}
