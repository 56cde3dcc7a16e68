//! What the emulated board does when it fails: it resets itself, says why, and goes on.

use std::fmt;
use std::fs;
use std::path::Path;

use link::ResetCause;
use model::ADC_RATE_HZ;
use serde::Serialize;

use super::figures::{codes, different};
use super::heard::Heard;
use super::input::Input;
use super::{IMAGE, VIRTUAL_TIME, input};
use crate::benchmark::emulator::{self, Image, Machine};
use crate::benchmark::{cannot_write, make_folder};
use crate::failure::Failure;

/// What the image is asked for, and what its next `Hello` must say.
const WAYS: [(&str, ResetCause, &str); 3] = [
    ("hang", ResetCause::Watchdog, "watchdog"),
    ("panic", ResetCause::Fault, "asked to panic"),
    ("fault", ResetCause::Fault, "hard fault at 0x"),
];

/// Seconds of samples; the image fails after one, and begins with them again.
const SECONDS: usize = 3;

/// A failure, and what came after.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Recovery {
    asked: &'static str,
    /// Codes before the failure, and after it.
    codes: [usize; 2],
    /// What the second `Hello` says.
    said: String,
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

impl Recovery {
    /// Lets the image fail in every way.
    ///
    /// # Errors
    /// QEMU fails, or the image does not come to its end.
    pub(super) fn of_every_failure(
        image: &Image,
        machine: Machine,
        folder: &Path,
        input: &Input,
        expected: &Heard,
    ) -> Result<Vec<Self>, Failure> {
        let folder = folder.join("failures");
        make_folder(&folder)?;
        let samples = folder.join(input::FILE);
        let bytes = input.bytes_of_first(SECONDS * usize::from(ADC_RATE_HZ));
        fs::write(&samples, bytes).map_err(|error| cannot_write(&samples, &error))?;
        let mut recoveries = Vec::new();
        for (word, cause, text) in WAYS {
            let uart = format!("{word}.uart");
            let mut command = image.command(machine, &folder, &[IMAGE, "start", word]);
            command.args(["-icount", VIRTUAL_TIME]);
            command.args(["-serial", &format!("file:{uart}")]);
            emulator::run_to_end(&mut command, super::PATIENCE, |_| ())?;
            let sent = folder.join(uart);
            let sent = fs::read(&sent).map_err(|error| cannot_write(&sent, &error))?;
            let boots = Heard::boots(&sent);
            recoveries.push(Self::new(word, cause, text, &boots, expected));
        }
        Ok(recoveries)
    }

    fn new(
        asked: &'static str,
        cause: ResetCause,
        text: &str,
        boots: &[Heard],
        expected: &Heard,
    ) -> Self {
        let mut recovery = Self {
            asked,
            codes: [0; 2],
            said: String::new(),
            faults: Vec::new(),
        };
        let mut fault = |what: String| recovery.faults.push(format!("after `{asked}`: {what}"));
        let [before, after] = boots else {
            fault(format!("{} boots, 2 expected", boots.len()));
            return recovery;
        };
        match &after.hellos[..] {
            [hello] => {
                if hello.cause != cause || !hello.fault.contains(text) {
                    fault(format!("it introduces itself as {hello:?}"));
                }
                recovery.said.clone_from(&hello.fault);
            }
            hellos => fault(format!("{} introductions", hellos.len())),
        }
        // The file's codes, from its beginning, as if nothing had happened.
        let [before, after] = [before, after].map(codes);
        let all = 1 + (SECONDS * usize::from(model::STEP_RATE_HZ) - model::STEPS) / model::HOP;
        let expected = codes(expected);
        let [first, again] =
            [before.len(), all].map(|count| &expected[..count.min(expected.len())]);
        let wrong = different(first, &before) + different(again, &after);
        if wrong > 0 || before.is_empty() {
            let count = before.len();
            recovery.faults.push(format!(
                "after `{asked}`: {wrong} codes are not host-sim's; {count} came before"
            ));
        }
        recovery.codes = [before.len(), after.len()];
        recovery
    }
}

impl fmt::Display for Recovery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [before, after] = self.codes;
        write!(
            f,
            "{}: {before} codes, a reset, {after} codes from the beginning; it says {:?}",
            self.asked, self.said
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qemu::host;

    #[test]
    fn a_board_that_does_not_come_back_or_does_not_say_why_is_a_fault() {
        let seconds = |seconds: usize| {
            let input = Input::make(80).expect("an input");
            let samples = seconds * usize::from(ADC_RATE_HZ);
            let sent = host::sent(&input.samples[..samples]).expect("host-sim");
            Heard::boots(&sent).swap_remove(0)
        };
        let expected = seconds(4);
        let faults = |boots: &[Heard]| {
            let recovery = Recovery::new("panic", ResetCause::Fault, "asked", boots, &expected);
            recovery.faults.join("; ")
        };
        let boots = || {
            let mut boots = [seconds(1), seconds(SECONDS)];
            boots[1].hellos[0].cause = ResetCause::Fault;
            boots[1].hellos[0].fault = "asked to panic".to_owned();
            boots
        };
        assert_eq!(faults(&boots()), "");
        assert!(faults(&boots()[..1]).contains("1 boots, 2 expected"));
        let mut silent = boots();
        silent[1].hellos[0].fault.clear();
        assert!(faults(&silent).contains("it introduces itself as"));
        let mut short = boots();
        short[1].codes.pop();
        assert!(faults(&short).contains("1 codes are not host-sim's; 15 came before"));
    }
}
