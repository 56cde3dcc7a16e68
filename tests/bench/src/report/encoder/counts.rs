//! Instruction counts of the encoder on one emulated machine.

use anyhow::Context;
use emulator::Machine;
use model::HOP;
use serde::{Deserialize, Serialize};

use super::cycles::LoopCycles;
use crate::hop::COMPLETING;
use crate::kernel::SHORTCUT;
use crate::report::images::Range;
use crate::tally::Tally;

/// Instruction counts and memory that the image `encoder` prints, as TOML.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Printed {
    /// RAM for the state of acquisition and encoder, bytes.
    pub(crate) ram_bytes: u32,
    /// Number of instructions of the acquisition for the time steps of one hop.
    pub(crate) acquisition_per_code: u32,
    kernels: Vec<KernelCount>,
    /// For each input, the tally (fewest, most, total) of each time step of a hop.
    pub(crate) inputs: Vec<Vec<Tally>>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Counts {
    pub(crate) machine: &'static str,
    core: &'static str,
    /// For each time step of a hop, its fewest and most instructions over all inputs.
    steps: Vec<[u32; 2]>,
    /// Whether the instructions of each time step are the same for every input.
    pub(crate) constant: bool,
    kernels: Vec<KernelCount>,
    #[serde(flatten)]
    pub(crate) figures: Figures,
    /// Number of instructions per code outside the kernels: requantisation, sums, reordering.
    rest_per_code: i64,
    acquisition_per_code: u32,
    #[serde(skip)]
    pub(crate) ram_bytes: u32,
    /// Number of codes that differ from those that this PC computes.
    pub(crate) different_codes: usize,
    /// Computed cycles of the encoder's inner loops; empty if LLVM's tools are missing.
    pub(crate) loops: Vec<LoopCycles>,
    /// Reasons why figures of this machine are missing.
    pub(crate) skipped: Vec<String>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct KernelCount {
    name: String,
    insn_per_code: u32,
}

/// Instruction counts of the encoder, and their ratios.
///
/// Figures with `shortcut` in their names include the linear shortcut, which the built-in network
/// has. From the other figures, the instructions of the shortcut's matrix products are subtracted.
/// These instructions are counted separately and divided evenly among the time steps of a hop.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Figures {
    /// Sum, over the time steps of a hop, of each step's largest instruction count.
    insn_per_code: u32,
    pub(crate) insn_per_code_shortcut: u32,
    insn_after_last_sample: u32,
    insn_after_last_sample_shortcut: u32,
    /// Largest instruction count of any time step, divided by the mean of all time steps' smallest
    /// counts.
    worst_over_mean: f64,
    worst_over_mean_shortcut: f64,
}

impl Counts {
    /// Computes the counts from the image's output. The caller fills in `loops`.
    ///
    /// # Errors
    /// The output has another number of time steps than a hop, or lacks the shortcut.
    pub(crate) fn new(
        machine: Machine,
        printed: Printed,
        different_codes: usize,
    ) -> anyhow::Result<Self> {
        let steps = Range::of_columns(&printed.inputs, HOP)?;
        let kernels = printed.kernels.iter();
        let in_kernels: u32 = kernels.map(|kernel| kernel.insn_per_code).sum();
        let mut kernels = printed.kernels.iter();
        let shortcut = kernels.find(|kernel| kernel.name == SHORTCUT);
        let shortcut = shortcut.with_context(|| format!("the image has not counted {SHORTCUT}"))?;
        let figures = Figures::new(&steps, shortcut.insn_per_code);
        Ok(Self {
            machine: machine.name,
            core: machine.core,
            steps: steps.iter().map(|step| [step.fewest, step.most]).collect(),
            constant: steps.iter().all(|step| step.constant),
            rest_per_code: i64::from(figures.insn_per_code_shortcut) - i64::from(in_kernels),
            kernels: printed.kernels,
            figures,
            acquisition_per_code: printed.acquisition_per_code,
            ram_bytes: printed.ram_bytes,
            different_codes,
            loops: Vec::new(),
            skipped: Vec::new(),
        })
    }
}

impl Figures {
    /// Computes the figures from the counts of a hop's time steps. The shortcut's matrix products
    /// take `shortcut` instructions per code.
    fn new(steps: &[Range], shortcut: u32) -> Self {
        let hop = u32::try_from(HOP).unwrap_or(u32::MAX);
        let in_step = shortcut / hop;
        let all = steps.iter().map(|step| step.most).sum::<u32>();
        let last = steps[COMPLETING].most;
        let worst_over_mean = |left_out| {
            let most = steps.iter().map(|step| step.most.saturating_sub(left_out));
            let fewest = steps.iter().map(|step| step.fewest.saturating_sub(left_out));
            f64::from(most.max().unwrap_or(u32::MAX)) * f64::from(hop)
                / f64::from(fewest.sum::<u32>())
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

#[cfg(test)]
mod tests {
    use emulator::MACHINES;

    use super::*;

    impl Counts {
        /// Returns counts of one input, for tests: the last time step of a hop takes `last`
        /// instructions, every other step 1000, and the shortcut 1600 per code.
        pub(crate) fn synthetic(last: u32) -> Self {
            let printed = format!(
                "ram_bytes = 35000
                acquisition_per_code = 7200
                kernels = [
                    {{ name = 'conv1', insn_per_code = 3000 }},
                    {{ name = '{SHORTCUT}', insn_per_code = 1600 }},
                ]
                inputs = [
                    [{} [{last}, {last}, {last}]],
                ]",
                "[1000, 1000, 1000], ".repeat(HOP - 1)
            );
            Self::new(MACHINES[0], toml::from_str(&printed).expect("the lines of an image"), 0)
                .expect("tallies of all steps and of the shortcut")
        }
    }

    #[test]
    fn the_shortcuts_products_are_subtracted_from_every_time_step() {
        let counts = Counts::synthetic(1500);
        // The last time step takes 1500 instructions, every other step 1000. The shortcut takes
        // 1600 instructions, the same number in each step: 200 if the hop has 8 time steps.
        let hop = u32::try_from(HOP).expect("at most 16");
        let (all, in_step) = (1_000 * hop + 500, 1_600 / hop);
        let expected = Figures {
            insn_per_code: all - 1_600,
            insn_per_code_shortcut: all,
            insn_after_last_sample: 1_500 - in_step,
            insn_after_last_sample_shortcut: 1_500,
            worst_over_mean: f64::from(1_500 - in_step) * f64::from(hop) / f64::from(all - 1_600),
            worst_over_mean_shortcut: 1_500.0 * f64::from(hop) / f64::from(all),
        };
        assert_eq!(counts.figures, expected);
        assert_eq!(counts.rest_per_code, i64::from(all) - 4_600);
    }
}
