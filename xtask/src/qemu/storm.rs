//! A host that gives a hundred commands a second, sound and unsound ones, while codes stream.

mod commands;

use std::fmt;
use std::fs;
use std::path::Path;
use std::thread;

use link::{Ack, ClockReading, Header, ToHost};
use model::ADC_RATE_HZ;
use serde::Serialize;

use self::commands::{EVERY_US, read_as_a_board, storm};
use super::figures::{Said, codes, different};
use super::frames;
use super::heard::Heard;
use super::input::Input;
use super::script::Script;
use super::stages::Stages;
use super::{IMAGE, PATIENCE, VIRTUAL_TIME, input};
use crate::benchmark::emulator::{self, Image, Machine};
use crate::benchmark::{cannot_write, make_folder};
use crate::failure::Failure;

/// Longest storm: seconds of samples.
const SECONDS: usize = 60;
/// Most microseconds from a command to when the board has read it: the conversation comes after the
/// acquisition.
const READ_WITHIN_US: u64 = 5_000;

/// What the storm was, and what came of it.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Storm {
    seconds: usize,
    /// Commands that must be answered, repeated ones included.
    commands: usize,
    /// Frames that must not be.
    unusable: u32,
    /// Answers that are not the expected ones, in their order.
    different_answers: usize,
    codes: usize,
    different_codes: usize,
    overruns: u32,
    /// Whether a second run has sent the same bytes, but for times.
    repeatable: bool,
    pub(super) stages: Stages,
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

/// A run of it.
struct Run {
    sent: Vec<u8>,
    said: Vec<String>,
}

impl Storm {
    /// Runs the image twice within a storm.
    ///
    /// # Errors
    /// QEMU fails, or the image does not come to its end.
    pub(super) fn of(
        image: &Image,
        machine: Machine,
        folder: &Path,
        input: &Input,
        expected: &Heard,
    ) -> Result<Self, Failure> {
        let folder = folder.join("storm");
        make_folder(&folder)?;
        let samples = input.samples.len().min(SECONDS * usize::from(ADC_RATE_HZ));
        let storm = storm(samples);
        storm.put_into(&folder)?;
        let path = folder.join(input::FILE);
        fs::write(&path, input.bytes_of_first(samples))
            .map_err(|error| cannot_write(&path, &error))?;
        let [first, second] = thread::scope(|scope| {
            ["first.uart", "second.uart"]
                .map(|uart| scope.spawn(|| run(image, machine, &folder, uart)))
                .map(|run| {
                    run.join()
                        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
                })
        });
        Ok(Self::new(&[first?, second?], &storm, samples, expected))
    }

    fn new(runs: &[Run; 2], storm: &Script, samples: usize, expected: &Heard) -> Self {
        let boots = Heard::boots(&runs[0].sent);
        let heard = &boots[0];
        let last = heard.stats.last().copied().unwrap_or_default();
        let answers = Answers::of(&runs[0].sent);
        let (sound, unusable) = read_as_a_board(storm.said());
        let steps = samples * usize::from(model::STEP_RATE_HZ) / usize::from(ADC_RATE_HZ);
        let count = 1 + (steps - model::STEPS) / model::HOP;
        let due = codes(expected);
        let different_codes = different(&due[..count.min(due.len())], &codes(heard));
        let seconds = samples / usize::from(ADC_RATE_HZ);
        let reports = &expected.quality[..seconds.min(expected.quality.len())];
        let said = Said::of(&runs[0].said);
        let overruns = said.overruns.max(last.overruns);
        let different_answers = different(&storm.answers, &answers.acks);
        let repeatable = but_times(&runs[0].sent) == but_times(&runs[1].sent);
        let stages = Stages::of(heard.timing.last());
        let checks = [
            (boots.len() == 1, format!("{} boots", boots.len())),
            (
                different_answers == 0,
                first_difference(&storm.answers, &answers.acks),
            ),
            (
                answers.late.is_none(),
                answers.late.clone().unwrap_or_default(),
            ),
            (
                different_codes == 0,
                format!("{different_codes} codes are not host-sim's"),
            ),
            (
                different(reports, &heard.quality) == 0,
                "reports on the electrodes are not host-sim's".to_owned(),
            ),
            (heard.jitter_us() == 0, "the codes' times jitter".to_owned()),
            (overruns == 0, format!("{overruns} overruns")),
            (
                said.samples == samples as u64,
                format!("{} of {samples} samples", said.samples),
            ),
            (
                last.frames_dropped == 0 && heard.missing == 0 && heard.damaged == 0,
                format!(
                    "{} frames dropped, {} missing, {} damaged",
                    last.frames_dropped, heard.missing, heard.damaged
                ),
            ),
            (
                (last.commands, last.input_bad) == (sound, unusable),
                format!(
                    "it counts {} commands and {} unusable frames of {sound} and {unusable}",
                    last.commands, last.input_bad
                ),
            ),
            (repeatable, "a second run has sent other frames".to_owned()),
        ];
        let faults = checks.into_iter().filter(|(sound, _)| !sound);
        let faults = faults
            .map(|(_, what)| what)
            .chain(stages.faults_when_busy());
        Self {
            seconds,
            commands: storm.answers.len(),
            unusable,
            different_answers,
            codes: heard.codes.len(),
            different_codes,
            overruns,
            repeatable,
            faults: faults
                .map(|what| format!("a storm of commands: {what}"))
                .collect(),
            stages,
        }
    }
}

fn run(image: &Image, machine: Machine, folder: &Path, uart: &str) -> Result<Run, Failure> {
    let mut command = image.command(machine, folder, &[IMAGE, "start", "commands"]);
    command.args(["-icount", VIRTUAL_TIME]);
    command.args(["-serial", &format!("file:{uart}")]);
    let said = emulator::run_to_end(&mut command, PATIENCE, |_| ())?;
    let uart = folder.join(uart);
    let sent = fs::read(&uart).map_err(|error| cannot_write(&uart, &error))?;
    Ok(Run { sent, said })
}

/// What a board has answered.
#[derive(Debug, Default)]
struct Answers {
    acks: Vec<Ack>,
    /// The first reading of a clock that is not of its time, if one is not.
    late: Option<String>,
}

impl Answers {
    fn of(sent: &[u8]) -> Self {
        let mut answers = Self::default();
        frames::each(sent, |header, message| match message {
            ToHost::Ack(ack) => answers.acks.push(*ack),
            ToHost::ClockReading(reading) if !is_of_its_time(&header, reading) => {
                let text = format!("{reading:?}, made at {} us", header.device_time_us);
                answers.late.get_or_insert(text);
            }
            _ => {}
        });
        answers
    }
}

/// Whether a clock was read soon after the host has asked, which tells the board's own time when it
/// does; repeated commands come ten milliseconds later each.
fn is_of_its_time(header: &Header, reading: &ClockReading) -> bool {
    let waited = reading.received_us.checked_sub(reading.host_time_us);
    waited.is_some_and(|waited| waited % EVERY_US <= READ_WITHIN_US)
        && header.device_time_us >= reading.received_us
}

/// The first answer that is not the expected one.
fn first_difference(expected: &[Ack], found: &[Ack]) -> String {
    let mut pairs = expected.iter().zip(found);
    match pairs.find(|(expected, found)| expected != found) {
        Some((expected, found)) => format!("it answers {found:?}, not {expected:?}"),
        None => format!("{} answers, {} expected", found.len(), expected.len()),
    }
}

/// All that was sent, but for the times at which it was, and for those that the board measures.
fn but_times(sent: &[u8]) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    frames::each(sent, |_, message| {
        all.push(match message {
            ToHost::Timing(_) => return,
            ToHost::ClockReading(reading) => {
                let host_time_us = reading.host_time_us;
                frames::alone(&ToHost::ClockReading(ClockReading {
                    host_time_us,
                    received_us: 0,
                }))
            }
            message => frames::alone(message),
        });
    });
    all
}

impl fmt::Display for Storm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let worst = self.stages.worst_over_deadline().unwrap_or(f64::NAN);
        write!(
            f,
            "a storm of {} commands and {} unusable frames within {} s: {} answers are not the expected \
             ones; {} of {} codes are not host-sim's, {} overruns; worst stage {worst:.2} of its deadline",
            self.commands,
            self.unusable,
            self.seconds,
            self.different_answers,
            self.different_codes,
            self.codes,
            self.overruns
        )
    }
}

#[cfg(test)]
mod tests {
    use link::{AckResult, MAX_FRAME, VERSION};

    use super::*;
    use crate::qemu::host;

    /// Faults of a board that answers as expected and sends host-sim's codes, after `break_it`; its own
    /// counters and stages are left out.
    fn faults(break_it: impl Fn(&mut Vec<Ack>, &mut Vec<u8>)) -> String {
        let input = Input::make(60).expect("an input");
        let samples = input.samples.len();
        let mut sent = host::sent(&input.samples).expect("host-sim");
        let expected = Heard::boots(&sent).swap_remove(0);
        let storm = storm(samples);
        let mut answers = storm.answers.clone();
        break_it(&mut answers, &mut sent);
        let mut encoder = link::Encoder::starting_at(expected.frames);
        for ack in answers {
            let mut buffer = [0; MAX_FRAME];
            let frame = encoder.encode(0, &ToHost::Ack(ack), &mut buffer);
            sent.extend(frame.expect("a frame"));
        }
        let run = || Run {
            sent: sent.clone(),
            said: vec![format!("samples {samples}")],
        };
        let faults = Storm::new(&[run(), run()], &storm, samples, &expected).faults;
        let left_out = [
            "it counts 0 commands",
            "it has not said",
            "of stack were used",
        ];
        let faults = faults.into_iter();
        let faults = faults.filter(|fault| !left_out.iter().any(|words| fault.contains(words)));
        faults.collect::<Vec<_>>().join("; ")
    }

    #[test]
    fn an_answer_too_few_too_many_or_of_another_kind_is_a_fault() {
        assert_eq!(faults(|_, _| ()), "");
        let none = faults(|answers, _| answers.truncate(200));
        assert!(none.contains("answers, "), "{none}");
        let twice = faults(|answers, _| answers.insert(9, answers[9]));
        assert!(twice.contains("it answers Ack"), "{twice}");
        let wrong = faults(|answers, _| answers[40].result = AckResult::Failed);
        assert!(wrong.contains("Failed"), "{wrong}");
        let code = faults(|_, sent| sent[1_600] ^= 0x10);
        assert!(code.contains(" codes are not host-sim's"), "{code}");
    }

    #[test]
    fn a_clock_that_is_read_late_is_seen() {
        let header = |device_time_us| Header {
            version: VERSION,
            seq: 0,
            device_time_us,
        };
        let reading = |received_us| ClockReading {
            host_time_us: 50_000,
            received_us,
        };
        assert!(is_of_its_time(&header(50_300), &reading(50_200)));
        assert!(is_of_its_time(&header(60_300), &reading(60_200)));
        assert!(!is_of_its_time(&header(50_100), &reading(50_200)));
        assert!(!is_of_its_time(&header(58_000), &reading(57_000)));
        assert!(!is_of_its_time(&header(58_000), &reading(49_000)));
    }
}
