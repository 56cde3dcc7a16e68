//! The encoder's figures as a person reads them.

use std::fmt::{self, Formatter};

use bench::hop::COMPLETING;
use model::{HOP, STEP_RATE_HZ};

use super::{Instructions, MachineFigures, Report};

/// Clocks that the load is said for: an STM32F4's and an STM32H7's, MHz.
const CLOCKS_MHZ: [f64; 2] = [168.0, 480.0];

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
        self.budget(f)?;
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

    /// How much time each core has for it.
    fn budget(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let codes_per_s =
            f64::from(STEP_RATE_HZ) / f64::from(u32::try_from(HOP).unwrap_or(u32::MAX));
        write!(f, "Load (computed), acquisition included:")?;
        for (machine, clock) in self.machines.iter().zip(CLOCKS_MHZ) {
            let encoder = machine.instructions.insn_per_code_shortcut;
            let per_us = f64::from(encoder + machine.acquisition_per_code) * codes_per_s / 1e6;
            let cycles = clock / per_us;
            let core = machine.core;
            write!(
                f,
                " {per_us:.1} M instructions per second, for each of which a {core} at {clock} MHz has \
                 {cycles:.1} cycles;"
            )?;
        }
        writeln!(f, " cycles are not counted here")
    }
}

fn row(f: &mut Formatter<'_>, name: &str, figure: impl fmt::Display) -> fmt::Result {
    writeln!(f, "  {name:<42}{figure:>16}")
}

#[cfg(test)]
mod tests {
    use super::super::tests::report;

    #[test]
    fn the_table_has_every_step_and_the_load_of_both_clocks() {
        let text = report().to_string();
        assert!(text.contains("step 8, completes a code"), "{text}");
        // 8,500 + 7,200 instructions 16 times a second.
        assert!(text.contains("0.3 M instructions per second"), "{text}");
        assert!(text.contains("168 MHz has 668.8 cycles;"), "{text}");
        assert!(text.contains("24 codes byte for byte"), "{text}");
    }
}
