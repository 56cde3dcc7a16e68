//! The encoder's figures as a person reads them.

use std::fmt::{self, Formatter};

use bench::hop::COMPLETING;
use model::HOP;

use super::super::cycles::{REST_M4, REST_M7};
use super::{Instructions, MachineFigures, Report};

/// One of a machine's counts.
type Figure = fn(&Instructions) -> u32;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.machines(f)?;
        writeln!(
            f,
            "Elsewhere: the same layers, on other code and settings, without shortcut"
        )?;
        for other in &self.counted_elsewhere {
            row(f, other.name, other.insn_per_code)?;
        }
        writeln!(
            f,
            "Memory: {} bytes of state in acquisition and encoder; {} bytes of flash for \
             acquisition, encoder and their start-up code",
            self.ram_bytes, self.flash_bytes
        )?;
        for room in &self.rooms {
            writeln!(
                f,
                "  {:<42}{:>16} bytes of flash left, {} of RAM ({})",
                room.part, room.flash_left, room.ram_left, room.region
            )?;
        }
        self.cycles(f)?;
        writeln!(
            f,
            "Count {} over {}; {} codes {}",
            if self.constant_count {
                "constant"
            } else {
                "NOT constant"
            },
            self.inputs.join(", "),
            self.windows,
            if self.bytes_equal {
                "byte for byte the PC's"
            } else {
                "NOT the PC's"
            },
        )
    }
}

impl Report {
    /// Step by step and kernel by kernel, a column for each machine.
    fn machines(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let columns =
            |f: &mut Formatter<'_>, name: &str, figure: &dyn Fn(&MachineFigures) -> String| {
                write!(f, "  {name:<42}")?;
                for machine in &self.machines {
                    write!(f, "{:>16}", figure(machine))?;
                }
                writeln!(f)
            };
        writeln!(
            f,
            "Instructions of the encoder, a code per {HOP} steps (simulated)"
        )?;
        columns(f, "", &|machine| machine.core.to_owned())?;
        let counts: [(&str, Figure); 4] = [
            ("per code, without shortcut", |of| of.insn_per_code),
            ("per code, with shortcut", |of| of.insn_per_code_shortcut),
            ("after the last sample, without", |of| {
                of.insn_after_last_sample
            }),
            ("after the last sample, with", |of| {
                of.insn_after_last_sample_shortcut
            }),
        ];
        for (name, figure) in counts {
            columns(f, name, &|machine| {
                figure(&machine.instructions).to_string()
            })?;
        }
        columns(f, "worst step over mean, without", &|machine| {
            format!("{:.3}", machine.instructions.worst_over_mean)
        })?;
        columns(f, "worst step over mean, with", &|machine| {
            format!("{:.3}", machine.instructions.worst_over_mean_shortcut)
        })?;
        writeln!(f, "Step by step, with shortcut (a range: fewest and most)")?;
        for place in 0..HOP {
            let name = if place == COMPLETING {
                format!("step {}, completes a code", place + 1)
            } else {
                format!("step {}", place + 1)
            };
            columns(f, &name, &|machine| match machine.steps[place] {
                [fewest, most] if fewest == most => most.to_string(),
                [fewest, most] => format!("{fewest}-{most}"),
            })?;
        }
        writeln!(f, "Kernels alone, per code")?;
        let kernels = self.machines.first().map_or(0, |first| first.kernels.len());
        for index in 0..kernels {
            let name = self.machines[0].kernels[index].name;
            columns(f, name, &|machine| {
                machine.kernels[index].insn_per_code.to_string()
            })?;
        }
        columns(f, "rest", &|machine| machine.rest_per_code.to_string())?;
        columns(f, "acquisition, not part of the encoder", &|machine| {
            machine.acquisition_per_code.to_string()
        })
    }

    /// What follows in cycles.
    fn cycles(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "Cycles (computed, with shortcut): loops by ARM's table (Cortex-M4) and by llvm-mca, all other \
             instructions at {REST_M4} on a Cortex-M4 and {REST_M7} on a Cortex-M7; no wait states"
        )?;
        for machine in &self.machines {
            for each in &machine.loops.loops {
                let name = format!("{}, {} turns", each.name, each.turns_per_code);
                let table = each.arm_table.map(f64::from);
                writeln!(
                    f,
                    "  {name:<42}{:>16} instructions, {} by the table, {} by llvm-mca ({})",
                    each.instructions,
                    known(table, 0),
                    known(each.llvm_mca, 1),
                    machine.core
                )?;
            }
        }
        let cycles = &self.cycles;
        for (name, per_code, load) in [
            (
                "per code, Cortex-M4F, 168 MHz",
                cycles.cycles_per_code_m4,
                cycles.load_168_mhz_percent,
            ),
            (
                "the same, loops by llvm-mca",
                cycles.cycles_per_code_m4_llvm_mca,
                None,
            ),
            (
                "per code, Cortex-M7, 480 MHz",
                cycles.cycles_per_code_m7,
                cycles.load_480_mhz_percent,
            ),
        ] {
            write!(f, "  {name:<42}{:>16}", known(per_code, 0))?;
            match load {
                Some(load) => writeln!(f, " cycles, {load:.1} % of it")?,
                None => writeln!(f)?,
            }
        }
        Ok(())
    }
}

/// A figure, or that there is none.
fn known(figure: Option<f64>, digits: usize) -> String {
    figure.map_or("not computed".to_owned(), |figure| {
        format!("{figure:.digits$}")
    })
}

fn row(f: &mut Formatter<'_>, name: &str, figure: impl fmt::Display) -> fmt::Result {
    writeln!(f, "  {name:<42}{figure:>16}")
}

#[cfg(test)]
mod tests {
    use super::super::tests::report;

    #[test]
    fn the_table_has_every_step_and_says_what_is_not_computed() {
        let text = report().to_string();
        assert!(text.contains("step 8, completes a code"), "{text}");
        assert!(text.contains("STM32F446RE"), "{text}");
        assert!(text.contains("not computed"), "{text}");
        assert!(text.contains("24 codes byte for byte"), "{text}");
    }
}
