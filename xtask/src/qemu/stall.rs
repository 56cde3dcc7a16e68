//! A host that reads nothing for a while: the board loses whole frames, the oldest, and counts them.

use std::fmt;
use std::path::Path;
use std::time::Duration;

use serde::Serialize;

use super::figures::codes;
use super::heard::Heard;
use super::input::Input;
use super::{IMAGE, PATIENCE, VIRTUAL_TIME, pipes};
use crate::benchmark::emulator::{Image, Machine};
use crate::failure::Failure;

/// The full pipe is left alone for this part of the run; the board's queue is full after three seconds.
const STALLED: u32 = 3;

/// What came through a port that was stuck for a while.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Stall {
    /// Frames that arrived, and numbers that did not.
    frames: u32,
    frames_missing: u32,
    /// What the board says that it has dropped.
    frames_dropped: u32,
    codes: usize,
    different_codes: usize,
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

impl Stall {
    /// Runs the image behind a pipe that is read only once it has been full for a while; the whole run
    /// takes about `wall` here.
    ///
    /// # Errors
    /// The pipe cannot be made, or QEMU fails.
    pub(super) fn of(
        image: &Image,
        machine: Machine,
        folder: &Path,
        input: &Input,
        expected: &Heard,
        wall: Duration,
    ) -> Result<Self, Failure> {
        let mut command = image.command(machine, folder, &[IMAGE, "start"]);
        command.args(["-icount", VIRTUAL_TIME]);
        let patience = PATIENCE + input.duration();
        let sent = pipes::run_to_end(&mut command, folder, &[], patience, wall / STALLED)?;
        Ok(Self::new(&Heard::boots(&sent), expected))
    }

    fn new(boots: &[Heard], expected: &Heard) -> Self {
        let heard = &boots[0];
        let last = heard.stats.last().copied().unwrap_or_default();
        let expected = codes(expected);
        let codes = codes(heard);
        let same = |code: &&link::Code| expected.get(code.window as usize) == Some(*code);
        let different = codes.len() - codes.iter().filter(same).count();
        let newest = codes.last().map_or(0, |code| code.window as usize);
        let checks = [
            (boots.len() == 1, format!("{} boots", boots.len())),
            (
                last.frames_dropped > 0,
                "nothing was dropped: the port was not stuck".to_owned(),
            ),
            (
                heard.missing == last.frames_dropped,
                format!(
                    "{} numbers are missing, {} counted",
                    heard.missing, last.frames_dropped
                ),
            ),
            (
                heard.damaged == 0,
                format!("{} damaged frames", heard.damaged),
            ),
            (
                different == 0,
                format!("{different} codes are not host-sim's"),
            ),
            (last.overruns == 0, format!("{} overruns", last.overruns)),
            (
                newest + 2 * usize::from(model::STEP_RATE_HZ) / model::HOP > expected.len(),
                format!("the newest code is {newest} of {}", expected.len()),
            ),
        ];
        let faults = checks.into_iter().filter(|(sound, _)| !sound);
        Self {
            frames: heard.frames,
            frames_missing: heard.missing,
            frames_dropped: last.frames_dropped,
            codes: codes.len(),
            different_codes: different,
            faults: faults
                .map(|(_, what)| format!("a stalled host: {what}"))
                .collect(),
        }
    }
}

impl fmt::Display for Stall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a host that stops reading: {} frames came, {} are missing, {} counted as dropped",
            self.frames, self.frames_missing, self.frames_dropped
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qemu::{host, input::Input};

    #[test]
    fn a_stall_must_cost_frames_and_each_must_be_counted() {
        let sent = host::sent(&Input::make(80).expect("an input").samples).expect("host-sim");
        let boots = Heard::boots(&sent);
        let faults = |boots: &[Heard]| Stall::new(boots, &Heard::boots(&sent)[0]).faults;
        assert_eq!(
            faults(&boots),
            ["a stalled host: nothing was dropped: the port was not stuck"]
        );

        let dropping = |counted, missing| {
            let mut boots = Heard::boots(&sent);
            boots[0].missing = missing;
            boots[0].stats.last_mut().expect("counters").frames_dropped = counted;
            boots
        };
        assert!(faults(&dropping(3, 3)).is_empty());
        let uncounted = faults(&dropping(3, 4)).join("; ");
        assert!(
            uncounted.contains("4 numbers are missing, 3 counted"),
            "{uncounted}"
        );
        let mut old = dropping(3, 3);
        old[0].codes.truncate(20);
        let old = faults(&old).join("; ");
        assert!(old.contains("the newest code is 19 of 80"), "{old}");
        let mut wrong = dropping(3, 3);
        wrong[0].codes[5].1.window += 1;
        let wrong = faults(&wrong).join("; ");
        assert!(wrong.contains("1 codes are not host-sim's"), "{wrong}");
    }
}
