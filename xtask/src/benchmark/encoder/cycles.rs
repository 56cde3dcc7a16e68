//! Cycles that follow from counted instructions: computed, not seen on any processor.

use model::{HIDDEN, HOP, NETWORK, POOLED, POOLED_STEPS, SHORTCUT_STEPS, STEP_RATE_HZ};
use serde::Serialize;

use super::disassembly::{Loop, disassemble, tool};
use crate::benchmark::emulator::{Image, Machine};

/// Cycles of an instruction outside the loops: on a Cortex-M4 that of a load that follows no other, the
/// dearest of what is common there; a Cortex-M7 issues up to two at once.
pub(crate) const REST_M4: f64 = 2.0;
pub(crate) const REST_M7: f64 = 1.0;
/// Cycles of a taken branch: 1 + P with P = 1 to 3 on a Cortex-M4 (ARM 100166, section 3.3.1). A
/// Cortex-M7 predicts it; the second cycle is for what it cannot issue beside it.
const BRANCH_M4: u32 = 3;
const BRANCH_M7: u32 = 2;

/// A loop of the encoder: its function, what its turns are told by, and how much of that a code needs.
struct Work {
    function: &'static str,
    /// Instructions that do a fixed share of the work.
    names: &'static [&'static str],
    /// How many of them a code takes.
    per_code: usize,
}

/// The loops in which most of the time goes.
fn work() -> [Work; 4] {
    let multiplications: &[&str] = &["smlad", "smuad"];
    // Products of one step, with two weights in a pair of 16 bits; none in a mode without this branch.
    let fc = NETWORK.fc.first().into_iter().flatten();
    let fc = 2 * fc.map(|weights| weights.len()).sum::<usize>();
    let shortcut = 2 * NETWORK.shortcut.first().map_or(0, |weights| weights.len());
    [
        Work {
            function: "dots_1x14",
            names: multiplications,
            per_code: NETWORK.conv1().patches_len() * HIDDEN.channels * HOP,
        },
        Work {
            function: "dots_3x8",
            names: multiplications,
            per_code: 3 * NETWORK.conv2().transformed_len() * POOLED.channels * HOP,
        },
        Work {
            function: "quads",
            names: multiplications,
            per_code: fc * POOLED_STEPS + shortcut * SHORTCUT_STEPS,
        },
        Work {
            function: "tiles_of_pair",
            names: &["str"],
            per_code: POOLED.len() * HOP,
        },
    ]
}

/// A loop on one machine.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct LoopCycles {
    pub(crate) name: &'static str,
    pub(crate) turns_per_code: u32,
    pub(crate) instructions: u32,
    /// A turn by ARM's table; for a Cortex-M4 alone, there is none for others.
    pub(crate) arm_table: Option<u32>,
    /// A turn by llvm-mca.
    pub(crate) llvm_mca: Option<f64>,
}

/// The loops of one machine's image.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Loops {
    pub(crate) loops: Vec<LoopCycles>,
    /// Why there is less than there could be.
    pub(crate) skipped: Vec<String>,
}

impl Loops {
    /// Reads them out of the image.
    pub(crate) fn of(machine: Machine, image: &Image) -> Self {
        let core = machine.core;
        let skip = |why: String| Self {
            loops: Vec::new(),
            skipped: vec![format!("cycles of the {core}: {why}")],
        };
        let Some(disassembly) = disassemble(image.path()) else {
            return skip("no llvm-objdump; Debian's package is `llvm`".to_owned());
        };
        let mca = tool("llvm-mca");
        let mut found = Self::default();
        if mca.is_none() {
            let why = "no llvm-mca; Debian's package is `llvm`";
            found
                .skipped
                .push(format!("simulated cycles of the {core}: {why}"));
        }
        for work in work() {
            let function = work.function;
            let Some(body) = Loop::find(&disassembly, function) else {
                return skip(format!("{function} has no loop, or is not in the image"));
            };
            let share = body.named(work.names);
            if share == 0 || !work.per_code.is_multiple_of(share) {
                return skip(format!(
                    "{function} does {share} at a time, the network takes {}: other loops run",
                    work.per_code
                ));
            }
            let is_m7 = core == "Cortex-M7";
            let (cpu, branch) = if is_m7 {
                ("cortex-m7", BRANCH_M7)
            } else {
                ("cortex-m4", BRANCH_M4)
            };
            let simulated = mca.as_ref().and_then(|mca| body.simulated(mca, cpu));
            found.loops.push(LoopCycles {
                name: function,
                turns_per_code: u32::try_from(work.per_code / share).unwrap_or(u32::MAX),
                instructions: body.count(),
                arm_table: (!is_m7).then(|| arm_table(&body.instructions) + BRANCH_M4),
                llvm_mca: simulated.map(|cycles| cycles + f64::from(branch)),
            });
        }
        found
    }

    /// Cycles of a code of so many instructions: a turn's cycles for each turn, `rest` for each
    /// instruction outside the loops. Nothing where a loop is not known.
    fn per_code(
        &self,
        instructions: u32,
        rest: f64,
        turn: impl Fn(&LoopCycles) -> Option<f64>,
    ) -> Option<f64> {
        let mut outside = instructions;
        let mut cycles = 0.0;
        for each in &self.loops {
            outside = outside.checked_sub(each.turns_per_code * each.instructions)?;
            cycles += f64::from(each.turns_per_code) * turn(each)?;
        }
        (!self.loops.is_empty()).then(|| cycles + rest * f64::from(outside))
    }
}

/// Cycles per code, with the shortcut, and the share of a clock that they take. Memory without wait
/// states.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(crate) struct Estimate {
    /// Cortex-M4: the loops by ARM's table.
    pub(crate) cycles_per_code_m4: Option<f64>,
    /// Cortex-M4: the loops by llvm-mca, which counts a load of several words for less.
    pub(crate) cycles_per_code_m4_llvm_mca: Option<f64>,
    /// Cortex-M7: the loops by llvm-mca.
    pub(crate) cycles_per_code_m7: Option<f64>,
    /// Of a Cortex-M4 at 168 MHz.
    pub(crate) load_168_mhz_percent: Option<f64>,
    /// Of a Cortex-M7 at 480 MHz.
    pub(crate) load_480_mhz_percent: Option<f64>,
}

impl Estimate {
    /// From each machine's loops and instructions per code.
    pub(crate) fn of<'l>(machines: impl IntoIterator<Item = (Machine, &'l Loops, u32)>) -> Self {
        let mut cycles = Self::default();
        let percent = |cycles: Option<f64>, mhz: f64| cycles.map(|cycles| load(cycles, mhz));
        for (machine, loops, instructions) in machines {
            if machine.core == "Cortex-M7" {
                let by_mca = loops.per_code(instructions, REST_M7, |turn| turn.llvm_mca);
                cycles.cycles_per_code_m7 = by_mca;
                cycles.load_480_mhz_percent = percent(by_mca, 480.0);
            } else {
                let by_table = |turn: &LoopCycles| turn.arm_table.map(f64::from);
                let by_table = loops.per_code(instructions, REST_M4, by_table);
                cycles.cycles_per_code_m4 = by_table;
                cycles.load_168_mhz_percent = percent(by_table, 168.0);
                cycles.cycles_per_code_m4_llvm_mca =
                    loops.per_code(instructions, REST_M4, |turn| turn.llvm_mca);
            }
        }
        cycles
    }
}

/// Percent of a clock.
fn load(cycles_per_code: f64, mhz: f64) -> f64 {
    let codes_per_second = f64::from(STEP_RATE_HZ) / f64::from(u32::try_from(HOP).unwrap_or(1));
    100.0 * cycles_per_code * codes_per_second / (mhz * 1e6)
}

/// Cycles on a Cortex-M4 by ARM's table (ARM 100166, section 3.3.1): a load or store of n words 1 + n, a
/// single one 2, or 1 directly behind another single one; everything else here 1.
fn arm_table(instructions: &[String]) -> u32 {
    let mut cycles = 0;
    let mut was_single = false;
    for instruction in instructions {
        let name = instruction.split([' ', '.']).next().unwrap_or(instruction);
        let registers = instruction.split_once('{').map_or(0, |(_, list)| {
            u32::try_from(list.split(',').count()).unwrap_or(u32::MAX)
        });
        let is_single = matches!(name, "ldr" | "str" | "ldrh" | "strh" | "ldrsb");
        cycles += match name {
            "ldm" | "stm" | "push" | "pop" => 1 + registers,
            "ldrd" | "strd" => 3,
            _ if is_single && !was_single => 2,
            _ => 1,
        };
        was_single = is_single;
    }
    cycles
}

#[cfg(test)]
mod tests {
    use super::super::super::emulator::MACHINES;
    use super::super::disassembly::tests::DISASSEMBLY;
    use super::*;

    fn loops(turns_per_code: u32) -> Loops {
        Loops {
            loops: vec![LoopCycles {
                name: "quads",
                turns_per_code,
                instructions: 10,
                arm_table: Some(15),
                llvm_mca: Some(12.5),
            }],
            skipped: Vec::new(),
        }
    }

    #[test]
    fn arm_s_table_counts_words_and_loads_behind_loads() {
        let body = Loop::find(DISASSEMBLY, "quads").expect("a loop");
        // LDM of four 5, LDRD 3, SMLAD 1, LDR 2, LDR behind it 1, STR behind it 1, CMP 1.
        assert_eq!(arm_table(&body.instructions), 14);
    }

    #[test]
    fn a_code_is_its_turns_and_the_rest() {
        let loops = loops(100);
        let [m4, m7] = MACHINES.map(|machine| (machine, &loops, 1_200));
        let cycles = Estimate::of([m4, m7]);
        assert_eq!(cycles.cycles_per_code_m4, Some(1_500.0 + 400.0));
        assert_eq!(cycles.cycles_per_code_m4_llvm_mca, Some(1_250.0 + 400.0));
        assert_eq!(cycles.cycles_per_code_m7, Some(1_250.0 + 200.0));
        assert_eq!(cycles.load_168_mhz_percent, Some(1_900.0 * 16.0 / 1.68e6));
    }

    #[test]
    fn what_is_not_known_is_null_and_not_a_number() {
        let none = Loops::default();
        assert_eq!(
            Estimate::of([(MACHINES[0], &none, 1_200)]).cycles_per_code_m4,
            None
        );
        // More instructions in the loops than were counted in all: the turns are wrong.
        let many = loops(121);
        assert_eq!(
            Estimate::of([(MACHINES[0], &many, 1_200)]).cycles_per_code_m4,
            None
        );
    }
}
