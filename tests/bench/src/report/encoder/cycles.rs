//! Computes cycles from counted instructions, with the loops that LLVM's tools find in the built
//! image. The cycles are not measured on a processor.

use std::fs;
use std::path::Path;

use anyhow::{Context, ensure};
use emulator::{EmulatorError, Image, Machine};
use model::{
    HAS_CONVOLUTIONS, HIDDEN, HOP, NETWORK, POOLED, POOLED_STEPS, SHORTCUT_STEPS, STEP_RATE_HZ,
};
use serde::Serialize;

use crate::report::programs;

/// Cycles that every instruction outside the loops is assumed to take on a Cortex-M4: as many as
/// the slowest common instruction, a load that does not follow another load.
pub(crate) const REST_M4: f64 = 2.0;
/// Cycles that every instruction outside the loops is assumed to take on a Cortex-M7, although it
/// can issue two at once.
pub(crate) const REST_M7: f64 = 1.0;
/// Assumed cycles of a taken branch on a Cortex-M4: 1 + P, where P is 1 to 3 cycles to refill the
/// pipeline (ARM 100166, section 3.3.1); here P = 2.
const BRANCH_M4: u32 = 3;
/// Assumed cycles of a loop's branch on a Cortex-M7, not measured: one for the predicted branch,
/// and one because the instruction before the branch may not be issued together with it.
const BRANCH_M7: u32 = 2;

/// Names of the instructions that multiply two pairs of 16-bit numbers.
const PRODUCTS: &[&str] = &["smlad", "smuad"];

/// Cycles, on one machine, of one of the encoder's inner loops, which take most of its time.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct LoopCycles {
    name: &'static str,
    /// Number of iterations of the loop that a code needs.
    turns_per_code: u32,
    /// Number of instructions of one iteration, including the branch back to its start.
    instructions: u32,
    /// Cycles of one iteration by ARM's table, including the branch back to its start. `None` for
    /// the Cortex-M7, for which ARM publishes no table.
    pub(crate) arm_table: Option<u32>,
    /// Cycles that llvm-mca predicts for one iteration, including the branch back to its start.
    pub(crate) llvm_mca: f64,
}

/// Finds the inner loops in the image `encoder` and computes their cycles.
///
/// # Errors
/// LLVM's tools are not installed, or the image has other loops than expected.
pub(crate) fn loops(machine: Machine, image: &Image) -> anyhow::Result<Vec<LoopCycles>> {
    let disassembly = disassemble(image.path())?;
    let is_m7 = machine.core == "Cortex-M7";
    let (cpu, branch) = if is_m7 { ("cortex-m7", BRANCH_M7) } else { ("cortex-m4", BRANCH_M4) };
    let mut loops = Vec::new();
    for (name, products, per_code) in work() {
        let body = Loop::find(&disassembly, name)
            .with_context(|| format!("{name} has no loop, or is not in the image"))?;
        let is_product = |line: &&String| products.iter().any(|name| line.starts_with(name));
        let share = body.instructions.iter().filter(is_product).count();
        ensure!(
            share > 0 && per_code.is_multiple_of(share),
            "{name} does {share} at a time, the network takes {per_code}: other loops run"
        );
        let source = image.path().with_extension("s");
        loops.push(LoopCycles {
            name,
            turns_per_code: u32::try_from(per_code / share)?,
            // Count the branch back to the loop's start too, which `body` leaves out.
            instructions: u32::try_from(body.instructions.len() + 1)?,
            arm_table: (!is_m7).then(|| arm_table(&body.instructions) + branch),
            llvm_mca: body.simulated(cpu, &source)? + f64::from(branch),
        });
    }
    Ok(loops)
}

/// Returns the work of each loop for a code: the loop's function, the kinds of instructions that
/// are counted, and their number per code. A network without convolutions has only one of the
/// loops.
fn work() -> impl Iterator<Item = (&'static str, &'static [&'static str], usize)> {
    // Product instructions for one time step: two for each `Pair`, which holds four 8-bit weights;
    // 0 if the network lacks the layer.
    let fc = NETWORK.fc.first().into_iter().flatten();
    let fc = 2 * fc.map(|weights| weights.len()).sum::<usize>();
    let shortcut = 2 * NETWORK.shortcut.first().map_or(0, |weights| weights.len());
    let conv1 = NETWORK.conv1().patches_len() * HIDDEN.channels;
    let conv2 = 3 * NETWORK.conv2().transformed_len() * POOLED.channels;
    let linear = fc * POOLED_STEPS + shortcut * SHORTCUT_STEPS;
    let planes = if HAS_CONVOLUTIONS { HOP } else { 0 };
    let work: [(_, &[_], _); _] = [
        ("dots_1x14", PRODUCTS, conv1 * planes),
        ("dots_3x8", PRODUCTS, conv2 * planes),
        ("quads", PRODUCTS, linear),
        ("tiles_of_pair", &["str"], POOLED.len() * planes),
    ];
    work.into_iter().filter(|(_, _, per_code)| *per_code > 0)
}

/// Returns the cycles that it takes to compute one code with `instructions` instructions, or `None`
/// if the cycles of a loop are unknown. `iteration` returns the cycles of a loop's iteration; each
/// instruction outside the loops takes `rest` cycles.
pub(crate) fn per_code(
    loops: &[LoopCycles],
    instructions: u32,
    rest: f64,
    iteration: fn(&LoopCycles) -> Option<f64>,
) -> Option<f64> {
    let mut outside = instructions;
    let mut cycles = 0.0;
    for each in loops {
        outside = outside.checked_sub(each.turns_per_code * each.instructions)?;
        cycles += f64::from(each.turns_per_code) * iteration(each)?;
    }
    (!loops.is_empty()).then(|| cycles + rest * f64::from(outside))
}

/// Returns the percentage of a processor's cycles that it takes to compute the codes of a live
/// stream.
pub(crate) fn load_percent(cycles_per_code: f64, mhz: f64) -> f64 {
    let codes_per_second = f64::from(STEP_RATE_HZ) / f64::from(u32::try_from(HOP).unwrap_or(1));
    100.0 * cycles_per_code * codes_per_second / (mhz * 1e6)
}

/// Returns the cycles of instructions on a Cortex-M4 by ARM's table (ARM 100166, section 3.3.1). A
/// load or store of n words takes n + 1 cycles, but only 1 cycle if both this instruction and the
/// previous one load or store a single word. Every other instruction here takes 1 cycle.
fn arm_table(instructions: &[String]) -> u32 {
    let mut cycles = 0;
    let mut was_single = false;
    for instruction in instructions {
        let name = instruction.split([' ', '.']).next().unwrap_or(instruction);
        let registers = instruction
            .split_once('{')
            .map_or(0, |(_, list)| u32::try_from(list.split(',').count()).unwrap_or(u32::MAX));
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

/// Innermost loop of a function, without the branch back to its start.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Loop {
    /// Instructions of the loop in order, in the assembler's syntax.
    instructions: Vec<String>,
}

impl Loop {
    /// Finds the innermost loop of `function`: from the target of the first backward branch to that
    /// branch.
    fn find(disassembly: &str, function: &str) -> Option<Self> {
        let mut lines = disassembly.lines();
        let ends = [format!("::{function}::"), format!("::{function}>")];
        lines.find(|line| {
            line.ends_with(">:") && ends.iter().any(|end| line.contains(end.as_str()))
        })?;
        let mut seen: Vec<(u32, String)> = Vec::new();
        for line in lines.take_while(|line| !line.is_empty()) {
            let (address, instruction) = line.split_once(':')?;
            let address = u32::from_str_radix(address.trim(), 16).ok()?;
            let instruction = instruction.trim().replace('\t', " ");
            if let Some(target) = branch_target(&instruction)
                && let Some(first) = seen.iter().position(|(address, _)| *address == target)
            {
                let body = seen.drain(first..).map(|(_, instruction)| instruction);
                return Some(Self { instructions: body.collect() });
            }
            seen.push((address, instruction));
        }
        None
    }

    /// Simulates the loop with llvm-mca for the processor `cpu`, and returns the mean cycles of an
    /// iteration without its branch. llvm-mca reads the instructions from the file `source`.
    ///
    /// # Errors
    /// llvm-mca is not installed or does not know an instruction.
    fn simulated(&self, cpu: &str, source: &Path) -> anyhow::Result<f64> {
        const ITERATIONS: u32 = 100;
        let instructions = self.unconditional().join("\n");
        fs::write(source, format!(".syntax unified\n.thumb\n{instructions}\n"))
            .map_err(EmulatorError::file(source))?;
        let mut command = programs::llvm("llvm-mca")?;
        command.args(["-mtriple=thumbv7em-none-eabihf", "-mcpu", cpu]);
        command.arg(format!("-iterations={ITERATIONS}")).arg(source);
        let printed = programs::output_of(&mut command).context("llvm-mca fails")?;
        let mut lines = printed.lines();
        let cycles = lines.find_map(|line| line.strip_prefix("Total Cycles:"));
        let cycles: u32 = cycles.context("llvm-mca prints no cycles")?.trim().parse()?;
        Ok(f64::from(cycles) / f64::from(ITERATIONS))
    }

    /// Replaces each IT instruction with a NOP, and removes the conditions from the instructions
    /// that it covers: LLVM's model of the Cortex-M7 does not know IT. An instruction whose
    /// condition is false is assumed to take as long as an executed one.
    fn unconditional(&self) -> Vec<String> {
        let mut condition = "";
        let mut left = 0;
        let mut plain = Vec::new();
        for instruction in &self.instructions {
            let (name, operands) = instruction.split_once(' ').unwrap_or((instruction, ""));
            let is_it = name.starts_with('i') && name[1..].chars().all(|each| "te".contains(each));
            if is_it {
                (condition, left) = (operands.trim(), name.len() - 1);
                plain.push("nop".to_owned());
            } else if left > 0 {
                left -= 1;
                let (name, width) = name.split_at(name.find('.').unwrap_or(name.len()));
                let name = name.strip_suffix(condition).unwrap_or(name);
                plain.push(format!("{name}{width} {operands}"));
            } else {
                plain.push(instruction.clone());
            }
        }
        plain
    }
}

/// Disassembles all functions of an image.
///
/// # Errors
/// llvm-objdump is not installed or cannot read the image.
fn disassemble(image: &Path) -> anyhow::Result<String> {
    let mut command = programs::llvm("llvm-objdump")?;
    command.args(["--disassemble", "--demangle", "--no-show-raw-insn"]).arg(image);
    programs::output_of(&mut command).context("llvm-objdump fails")
}

/// Returns the target address of a conditional branch; `None` for any other instruction.
fn branch_target(instruction: &str) -> Option<u32> {
    let (name, operand) = instruction.split_once(' ')?;
    let name = name.strip_suffix(".w").unwrap_or(name);
    ["bne", "blo", "bhi"].contains(&name).then_some(())?;
    let address = operand.trim().strip_prefix("0x")?.split(' ').next()?;
    u32::from_str_radix(address, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Disassembly for the tests: a function with two nested loops, and one with a forward branch.
    const DISASSEMBLY: &str = "
0000562c <crate::cortex_m::quads::hc954fcd4a8abe7a6>:
    562c:      \tpush.w\t{r4, r5, lr}
    5630:      \tmovs\tr0, #0
    5640:      \tldm.w\tr12!, {r4, r5, r6, r7}
    5644:      \tldrd\tr8, r9, [r11], #8
    5648:      \tsmlad\tr0, r8, r4, r0
    564c:      \tldr\tr4, [r0]
    564e:      \tldr\tr5, [r1]
    5650:      \tstr\tr5, [r2]
    5720:      \tcmp\tr11, lr
    5722:      \tbne.w\t0x5640 <crate::cortex_m::quads::hc954+0x14> @ imm = #-230
    574c:      \tbne.w\t0x5630 <crate::cortex_m::quads::hc954+0x8> @ imm = #-284

00005754 <crate::cortex_m::straight::hfc2d6b2c5c32b2e8>:
    5754:      \tbne\t0x5790 <crate::cortex_m::straight::hfc+0x8> @ imm = #-284
";

    impl Loop {
        /// Returns the inner loop of the function `quads` in the test's disassembly.
        pub(crate) fn of_quads() -> Self {
            Self::find(DISASSEMBLY, "quads").expect("a loop")
        }
    }

    #[test]
    fn the_innermost_loop_is_found_by_its_branch() {
        let found = Loop::of_quads();
        assert_eq!(found.instructions.len(), 7);
        assert_eq!(found.instructions[0], "ldm.w r12!, {r4, r5, r6, r7}");
        assert_eq!(found.instructions[6], "cmp r11, lr");
        assert_eq!(Loop::find(DISASSEMBLY, "straight"), None);
        assert_eq!(Loop::find(DISASSEMBLY, "quad"), None);
    }

    #[test]
    fn an_it_instruction_makes_as_many_instructions_unconditional_as_it_covers() {
        let listing = |text: &str| text.split("; ").map(str::to_owned).collect::<Vec<_>>();
        let instructions =
            listing("cmp r6, r5; itt lt; movlt r6, r5; addlt.w r1, r1, r2; movslt r1, r2");
        let plain = listing("cmp r6, r5; nop; mov r6, r5; add.w r1, r1, r2; movslt r1, r2");
        assert_eq!(Loop { instructions }.unconditional(), plain);
    }

    #[test]
    fn arms_table_counts_words_and_loads_after_loads() {
        // The expected cycles: LDM of four words 5, LDRD 3, SMLAD 1, LDR 2, the next LDR 1, the STR
        // after it 1, CMP 1.
        assert_eq!(arm_table(&Loop::of_quads().instructions), 14);
    }

    #[test]
    fn the_cycles_of_a_code_are_those_of_its_iterations_and_the_rest() {
        let quads = |turns_per_code| LoopCycles {
            name: "quads",
            turns_per_code,
            instructions: 10,
            arm_table: Some(15),
            llvm_mca: 12.5,
        };
        let by_table = |loops: &[LoopCycles], rest| {
            per_code(loops, 1_200, rest, |each| each.arm_table.map(f64::from))
        };
        assert_eq!(by_table(&[quads(100)], REST_M4), Some(1_500.0 + 400.0));
        assert_eq!(by_table(&[quads(100)], REST_M7), Some(1_500.0 + 200.0));
        assert_eq!(by_table(&[], REST_M4), None);
        // 121 iterations of 10 instructions exceed the code's 1200 instructions, so the number of
        // iterations must be wrong, and there is no result.
        assert_eq!(by_table(&[quads(121)], REST_M4), None);
        let load = load_percent(1_900.0, 168.0);
        let codes = f64::from(STEP_RATE_HZ) / f64::from(u32::try_from(HOP).expect("at most 16"));
        assert!((load - 1_900.0 * codes / 1.68e6).abs() < 1e-12, "{load}");
    }
}
