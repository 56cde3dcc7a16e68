//! Inner loops of a built image, as LLVM's tools show them.

use std::fs;
use std::path::Path;

use anyhow::Context;
use emulator::EmulatorError;

use crate::report::tools;

/// Innermost loop of a function, without the branch that closes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Loop {
    /// Instructions in order, in the assembler's syntax.
    pub(crate) instructions: Vec<String>,
}

impl Loop {
    /// Finds the innermost loop of the function `function`: the instructions from the target of the first
    /// backward branch up to that branch.
    pub(crate) fn find(disassembly: &str, function: &str) -> Option<Self> {
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
                return Some(Self {
                    instructions: body.collect(),
                });
            }
            seen.push((address, instruction));
        }
        None
    }

    /// Simulates the loop with llvm-mca for the processor `cpu`, and returns the mean number of cycles per
    /// iteration, without the branch. Writes the instructions to the file `source`, which llvm-mca reads.
    ///
    /// # Errors
    /// llvm-mca is not installed or does not know an instruction.
    pub(crate) fn simulated(&self, cpu: &str, source: &Path) -> anyhow::Result<f64> {
        const ITERATIONS: u32 = 100;
        let instructions = self.unconditional().join("\n");
        fs::write(source, format!(".syntax unified\n.thumb\n{instructions}\n"))
            .map_err(EmulatorError::file(source))?;
        let mut command = tools::llvm("llvm-mca")?;
        command.args(["-mtriple=thumbv7em-none-eabihf", "-mcpu", cpu]);
        command.arg(format!("-iterations={ITERATIONS}")).arg(source);
        let printed = tools::output_of(&mut command).context("llvm-mca fails")?;
        let mut lines = printed.lines();
        let cycles = lines.find_map(|line| line.strip_prefix("Total Cycles:"));
        let cycles: u32 = cycles
            .context("llvm-mca prints no cycles")?
            .trim()
            .parse()?;
        Ok(f64::from(cycles) / f64::from(ITERATIONS))
    }

    /// Replaces each IT instruction with a NOP, and removes the conditions from the instructions that it
    /// covers: LLVM's model of the Cortex-M7 does not know IT. An instruction whose condition is false is
    /// assumed to take as long as an executed one.
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
pub(crate) fn disassemble(image: &Path) -> anyhow::Result<String> {
    let mut command = tools::llvm("llvm-objdump")?;
    command
        .args(["--disassemble", "--demangle", "--no-show-raw-insn"])
        .arg(image);
    tools::output_of(&mut command).context("llvm-objdump fails")
}

/// Returns the target address of a conditional branch; `None` for other instructions.
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

    /// A function with two nested loops, and one with a forward branch.
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
        /// Inner loop of the test function `quads`.
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
}
