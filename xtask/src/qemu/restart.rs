//! What a host may do to a board's runs: refused commands, other streams, starting anew.

use std::fmt;
use std::fs;
use std::path::Path;

use link::{Ack, AckResult, ResetCause, ResetInto, Streams, ToDevice, ToHost};
use model::ADC_RATE_HZ;
use serde::Serialize;

use super::heard::Heard;
use super::input::Input;
use super::script::Script;
use super::{IMAGE, PATIENCE, VIRTUAL_TIME, frames, input};
use crate::benchmark::emulator::{self, Image, Machine};
use crate::benchmark::{cannot_write, make_folder};
use crate::failure::Failure;

/// Seconds of samples.
const SECONDS: usize = 3;

/// From an order to start anew until the board does, microseconds: what waits has gone out by then.
const FAREWELL_US: u64 = 100_000;
/// The board's clock ticks at the next of its alarms.
const MARGIN_US: u64 = 5_000;

/// The host's clock.
const CLOCK_US: u64 = 1 << 50;

/// What the host says: device time in microseconds, command, answer; of the first boot, and of the
/// second.
const TALK: [&[(u64, ToDevice, AckResult)]; 2] = [
    &[
        (200_000, start(Streams::CODES), AckResult::Done),
        (600_000, ToDevice::SelfTest, AckResult::NotSupported),
        (
            610_000,
            ToDevice::Reset(ResetInto::Bootloader),
            AckResult::NotSupported,
        ),
        (
            620_000,
            ToDevice::Reset(ResetInto::Newer(7)),
            AckResult::BadArgument,
        ),
        (
            630_000,
            ToDevice::SyncTime {
                host_time_us: CLOCK_US,
            },
            AckResult::Done,
        ),
        (800_000, start(CODES_AND_STEPS), AckResult::Done),
        (
            1_300_000,
            ToDevice::Reset(ResetInto::Firmware),
            AckResult::Done,
        ),
    ],
    &[
        (200_000, start(Streams::CODES), AckResult::Done),
        (900_000, ToDevice::Stop, AckResult::Done),
    ],
];

const CODES_AND_STEPS: Streams =
    Streams::from_bits(Streams::CODES.bits() | Streams::FILTERED.bits());

const fn start(streams: Streams) -> ToDevice {
    ToDevice::Start(link::Start {
        streams,
        mains_hz: 0,
    })
}

/// What the board did.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Restart {
    /// Codes of each run: two before the reset, one after it.
    codes: Vec<usize>,
    /// Answers.
    answers: usize,
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

/// From a start to the next.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Run {
    windows: Vec<u32>,
    /// First ones of the frames of filtered steps.
    steps: Vec<u64>,
}

impl Run {
    /// Whether it begins at its beginning and has no gap.
    fn is_whole(&self) -> bool {
        let steps = (0..).step_by(link::FILTERED_STEPS);
        !self.windows.is_empty()
            && (0..).zip(&self.windows).all(|(due, window)| due == *window)
            && steps.zip(&self.steps).all(|(due, step)| due == *step)
    }
}

impl Restart {
    /// Lets the image be told all of it.
    ///
    /// # Errors
    /// QEMU fails, or the image does not come to its end.
    pub(super) fn of(
        image: &Image,
        machine: Machine,
        folder: &Path,
        input: &Input,
    ) -> Result<Self, Failure> {
        let folder = folder.join("restart");
        make_folder(&folder)?;
        let path = folder.join(input::FILE);
        let bytes = input.bytes_of_first(SECONDS * usize::from(ADC_RATE_HZ));
        fs::write(&path, bytes).map_err(|error| cannot_write(&path, &error))?;
        let script = script();
        script.put_into(&folder)?;
        let mut command = image.command(machine, &folder, &[IMAGE, "commands"]);
        command.args(["-icount", VIRTUAL_TIME, "-serial", "file:uart"]);
        emulator::run_to_end(&mut command, PATIENCE, |_| ())?;
        let uart = folder.join("uart");
        let sent = fs::read(&uart).map_err(|error| cannot_write(&uart, &error))?;
        Ok(Self::new(&sent, &script.answers))
    }

    fn new(sent: &[u8], expected: &[Ack]) -> Self {
        let boots = Heard::boots(sent);
        let runs = runs(sent);
        let mut acks = Vec::new();
        let mut clocks = Vec::new();
        // Device times of the answer to Reset and of what follows it, up to the next boot.
        let mut farewell = Vec::new();
        let mut counts_at_end = None;
        frames::each(sent, |header, message| {
            if let ToHost::Ack(ack) = message {
                acks.push(*ack);
            }
            if let ToHost::ClockReading(reading) = message {
                clocks.push(reading.host_time_us);
            }
            if acks.len() == TALK[0].len() && header.seq > 0 {
                farewell.push(header.device_time_us);
            }
            if let ToHost::Stats(stats) = message {
                counts_at_end = Some(*stats);
            }
        });
        let hellos: Vec<_> = boots.iter().flat_map(|boot| &boot.hellos).collect();
        let causes = hellos.iter().map(|hello| (hello.cause, &hello.fault[..]));
        let causes: Vec<_> = causes.collect();
        // Of another boot: its clock begins anew.
        let farewell = farewell.iter().take_while(|at_us| **at_us >= farewell[0]);
        let waited = farewell.clone().max().zip(farewell.clone().min());
        let waited = waited.map(|(last, first)| last - first);
        let checks = [
            (
                boots.len() == 2,
                format!("{} boots, 2 expected", boots.len()),
            ),
            (acks == expected, format!("it answers {acks:?}")),
            (
                causes == [(ResetCause::PowerOn, ""), (ResetCause::Software, "")],
                format!("it says {causes:?} of its boots"),
            ),
            (
                waited.is_some_and(|us| us > 0 && us < FAREWELL_US + MARGIN_US),
                format!("what it says after the answer ends {waited:?} us behind it"),
            ),
            (clocks == [CLOCK_US], format!("it reads clocks {clocks:?}")),
            (
                runs.len() == 3 && runs.iter().all(Run::is_whole),
                format!("{runs:?}: three runs that begin at 0 expected"),
            ),
            (
                runs.iter()
                    .map(|run| !run.steps.is_empty())
                    .eq([false, true, false]),
                "steps in another run than the second".to_owned(),
            ),
            (
                counts_at_end.is_some_and(|stats| stats.streams.is_empty()),
                format!("after the end it counts {counts_at_end:?}"),
            ),
            (
                boots
                    .iter()
                    .all(|boot| boot.missing == 0 && boot.damaged == 0),
                "frames are missing or damaged".to_owned(),
            ),
        ];
        let faults = checks.into_iter().filter(|(sound, _)| !sound);
        Self {
            codes: runs.iter().map(|run| run.windows.len()).collect(),
            answers: acks.len(),
            faults: faults
                .map(|(_, what)| format!("starting anew: {what}"))
                .collect(),
        }
    }
}

/// All that the host says.
fn script() -> Script {
    let mut script = Script::default();
    for (boot, talk) in (1..).zip(TALK) {
        for (at_us, command, result) in talk {
            script.command(boot, *at_us, command, *result);
        }
    }
    script
}

/// The runs of all boots: each begins with window 0, and, where it has steps, with those before it.
fn runs(sent: &[u8]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut of_now = |begins: bool, take: &mut dyn FnMut(&mut Run)| {
        if runs
            .last()
            .is_none_or(|run| begins && !run.windows.is_empty())
        {
            runs.push(Run::default());
        }
        runs.last_mut().into_iter().for_each(take);
    };
    frames::each(sent, |_, message| match message {
        ToHost::Code(code) => of_now(code.window == 0, &mut |run| run.windows.push(code.window)),
        ToHost::Filtered(steps) => of_now(steps.first_step == 0, &mut |run| {
            run.steps.push(steps.first_step);
        }),
        _ => {}
    });
    runs
}

impl fmt::Display for Restart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} commands to a board that runs, among them Start of other streams and Reset: {:?} codes, \
             each run from its beginning; refused what it cannot",
            self.answers, self.codes
        )
    }
}

#[cfg(test)]
mod tests {
    use link::{Code, Encoder, MAX_FRAME};

    use super::*;

    /// A board's frames: of a boot, and of what it sends at which time.
    fn sent(boots: &[Vec<(u64, ToHost<'_>)>]) -> Vec<u8> {
        let mut sent = Vec::new();
        for boot in boots {
            let mut encoder = Encoder::starting_at(0);
            for (at_us, message) in boot {
                let mut buffer = [0; MAX_FRAME];
                let frame = encoder.encode(*at_us, message, &mut buffer);
                sent.extend(frame.expect("a frame"));
            }
        }
        sent
    }

    /// What a sound board sends.
    fn boots() -> [Vec<(u64, ToHost<'static>)>; 2] {
        let answers = script().answers;
        let hello = |reset_cause| {
            let mut hello = link::Hello {
                reset_cause,
                ..hello()
            };
            hello.fault = "";
            (10, ToHost::Hello(hello))
        };
        let code = |at_us, window| (at_us, ToHost::Code(code(window)));
        let ack = |index: usize| (TALK.concat()[index].0, ToHost::Ack(answers[index]));
        let steps = |at_us, first_step| {
            let filtered = link::Filtered {
                first_step,
                electrodes: 1,
                fraction_bits: 5,
                flags: link::Flags::empty(),
                values: &[],
            };
            (at_us, ToHost::Filtered(filtered))
        };
        let reading = link::ClockReading {
            host_time_us: CLOCK_US,
            received_us: 630_010,
        };
        let first = vec![
            hello(ResetCause::PowerOn),
            ack(0),
            code(350_000, 0),
            code(410_000, 1),
            ack(1),
            ack(2),
            ack(3),
            (630_020, ToHost::ClockReading(reading)),
            ack(4),
            ack(5),
            steps(840_000, 0),
            steps(870_000, 4),
            code(930_000, 0),
            code(990_000, 1),
            ack(6),
            code(1_350_000, 2),
        ];
        let second = vec![
            hello(ResetCause::Software),
            ack(7),
            code(350_000, 0),
            (900_000, ToHost::Stats(link::Stats::default())),
            ack(8),
        ];
        [first, second]
    }

    fn hello() -> link::Hello<'static> {
        link::Hello {
            firmware: "",
            board: "",
            chip_uid: [0; 12],
            model_id: model::MODEL_ID,
            session_id: 1,
            reset_cause: ResetCause::PowerOn,
            fault: "",
        }
    }

    fn code(window: u32) -> Code {
        Code {
            model_id: model::MODEL_ID,
            window,
            first_sample: 0,
            flags: link::Flags::empty(),
            clipped: 0,
            clipped_values: 0,
            saturated: 0,
            values: link::CodeValues::Int8([0; link::CODE_LEN]),
        }
    }

    fn faults(change: impl FnOnce(&mut [Vec<(u64, ToHost<'static>)>; 2])) -> String {
        let mut boots = boots();
        change(&mut boots);
        Restart::new(&sent(&boots), &script().answers)
            .faults
            .join("; ")
    }

    #[test]
    fn a_board_that_does_not_start_anew_or_goes_on_where_it_was_is_a_fault() {
        assert_eq!(faults(|_| ()), "");
        let once = faults(|boots| boots[1].clear());
        assert!(once.contains("1 boots, 2 expected"), "{once}");
        let why = faults(|boots| boots[1][0] = boots[0][0].clone());
        assert!(why.contains("of its boots"), "{why}");
        let goes_on = faults(|boots| boots[0][12].1 = ToHost::Code(code(2)));
        assert!(goes_on.contains("three runs that begin at 0"), "{goes_on}");
        let refused = faults(|boots| {
            if let ToHost::Ack(ack) = &mut boots[0][5].1 {
                ack.result = AckResult::Done;
            }
        });
        assert!(refused.contains("it answers"), "{refused}");
        let late = faults(|boots| boots[0][15].0 += FAREWELL_US);
        assert!(late.contains("us behind it"), "{late}");
        let abrupt = faults(|boots| drop(boots[0].pop()));
        assert!(abrupt.contains("us behind it"), "{abrupt}");
    }
}
