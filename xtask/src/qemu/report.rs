//! What the emulated boards have sent, judged and shown.

use std::fmt;

use serde::Serialize;

use super::figures::MachineFigures;
use super::input::Input;
use crate::failure::Failure;

/// Everything that was found; the object of `--json`.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    /// Codes that were compared on each machine.
    codes: usize,
    /// Whether all of them, and what the boards say of their electrodes, are host-sim's: values, window,
    /// first sample, flags.
    equal_to_host: bool,
    /// Whether everything that the boards send when asked for all streams at once is host-sim's, and the
    /// raw samples are those that went in.
    streams_equal: bool,
    /// Whether a second run of each machine has sent the same bytes, but for its times.
    repeatable: bool,
    /// Samples that were not read in time, on both machines.
    overruns: u32,
    /// The worst time of any stage in any run over its deadline, other tasks and interrupts included; simulated, at
    /// 62.5 million instructions per second.
    worst_path_over_deadline: Option<f64>,
    machines: Vec<MachineFigures>,
    inputs: Vec<&'static str>,
    /// What could not be had.
    pub(super) skipped: Vec<String>,
    faults: Vec<String>,
}

impl Report {
    /// Puts the figures together.
    pub(super) fn new(input: &Input, machines: Vec<MachineFigures>) -> Self {
        let all = |sound: fn(&MachineFigures) -> bool| machines.iter().all(sound);
        let faults = machines.iter().flat_map(|machine| {
            let faults = machine.faults.iter();
            faults.map(|fault| format!("{fault} on {}", machine.machine))
        });
        Self {
            codes: machines
                .iter()
                .map(|machine| machine.codes)
                .min()
                .unwrap_or(0),
            equal_to_host: all(|machine| machine.different_codes + machine.different_reports == 0),
            streams_equal: all(|machine| machine.all_streams.equal),
            repeatable: all(|machine| machine.repeatable),
            overruns: machines.iter().map(|machine| machine.overruns).sum(),
            worst_path_over_deadline: machines
                .iter()
                .filter_map(MachineFigures::worst_over_deadline)
                .reduce(f64::max),
            faults: faults.collect(),
            machines,
            inputs: input.names.clone(),
            skipped: input.skipped.clone(),
        }
    }

    /// One object.
    pub(super) fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}"))
    }

    /// Whether nothing is wrong.
    ///
    /// # Errors
    /// Names what is.
    pub(super) fn judge(&self) -> Result<(), Failure> {
        if self.faults.is_empty() {
            return Ok(());
        }
        Err(Failure::Check {
            what: "the application on the emulated microcontroller".to_owned(),
            why: self.faults.join("; "),
            next: "compare with `git log` of firmware, device, pipeline and model".to_owned(),
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "The application on emulated microcontrollers, in virtual time (simulated), on {}",
            self.inputs.join(" and ")
        )?;
        writeln!(
            f,
            "{:12} {:12} {:>7} {:>10} {:>9} {:>8} {:>9} {:>7}",
            "machine", "core", "codes", "different", "overruns", "jitter", "bytes", "here"
        )?;
        for machine in &self.machines {
            writeln!(f, "{machine}")?;
        }
        writeln!(
            f,
            "{} codes on each: {} to host-sim's, a second run {}; {} overruns; worst stage {:.2} of its \
             deadline (simulated)",
            self.codes,
            if self.equal_to_host {
                "equal"
            } else {
                "NOT equal"
            },
            if self.repeatable {
                "the same bytes but for its times"
            } else {
                "DIFFERENT"
            },
            self.overruns,
            self.worst_path_over_deadline.unwrap_or(f64::NAN)
        )?;
        Ok(())
    }
}
