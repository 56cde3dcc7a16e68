//! What one emulated board has sent, compared.

use std::fmt;

use link::{Code, ResetCause, Stats};
use serde::Serialize;

use super::Runs;
use super::damage::Damage;
use super::failures::Recovery;
use super::heard::{Heard, Hello, but_times};
use super::input::Input;
use super::restart::Restart;
use super::stages::Stages;
use super::stall::Stall;
use super::storm::Storm;
use super::streams::AllStreams;
use crate::benchmark::emulator::Machine;

/// The board's name in `Hello`.
const BOARD: &str = "qemu-mps2";

/// What one machine has sent.
#[derive(Debug, Clone, Serialize)]
pub(super) struct MachineFigures {
    pub(super) machine: &'static str,
    core: &'static str,
    pub(super) codes: usize,
    /// Codes that are not host-sim's in values, window, first sample or flags; missing ones, too.
    pub(super) different_codes: usize,
    /// Reports on the electrodes that are not host-sim's.
    pub(super) different_reports: usize,
    /// Whether a second run has sent the same bytes, but for what it measured of its own times.
    pub(super) repeatable: bool,
    /// Whether those are the same, too. Presumably since QEMU's main loop is a thread of its own: on a busy PC an
    /// interrupt of the UART may come some instructions sooner or later.
    times_repeat: bool,
    samples: u64,
    pub(super) overruns: u32,
    /// Frames that were made and never sent.
    frames_dropped: u32,
    frames: u32,
    /// Numbers that no frame had.
    frames_missing: u32,
    frames_damaged: u32,
    bytes: usize,
    /// The longest that a code's device time differs from a whole number of hops behind the first.
    jitter_us: u64,
    /// The slower run, on this PC.
    wall_seconds: f64,
    /// How long its stages take.
    pub(super) stages: Stages,
    /// A run whose host stops reading for a while.
    stalled_host: Stall,
    /// Runs that fail, and what the next one says of it.
    failures: Vec<Recovery>,
    /// A run with a damaged model.
    damaged_model: Damage,
    /// A run with all streams and a trigger.
    pub(super) all_streams: AllStreams,
    /// A run within a storm of commands.
    storm: Storm,
    /// Runs that a host begins anew.
    restart: Restart,
    /// What is wrong.
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

impl MachineFigures {
    /// Compares the runs with each other, and the first with what host-sim sends.
    pub(super) fn new(machine: Machine, runs: Runs, input: &Input, expected: &Heard) -> Self {
        let [first, second] = &runs.undisturbed;
        let boots = Heard::boots(&first.sent);
        let heard = &boots[0];
        let last = heard.stats.last().copied().unwrap_or_default();
        let said = [&first.said, &second.said].map(|said| Said::of(said));
        let mut figures = Self {
            machine: machine.name,
            core: machine.core,
            codes: heard.codes.len(),
            different_codes: different(&codes(expected), &codes(heard)),
            different_reports: different(&expected.quality, &heard.quality),
            repeatable: but_times(&first.sent) == but_times(&second.sent)
                && first.said == second.said,
            times_repeat: first.sent == second.sent,
            samples: said[0].samples,
            overruns: said[0].overruns.max(said[1].overruns).max(last.overruns),
            frames_dropped: last.frames_dropped,
            frames: heard.frames,
            frames_missing: heard.missing,
            frames_damaged: heard.damaged,
            bytes: first.sent.len(),
            jitter_us: heard.jitter_us(),
            wall_seconds: first.wall.max(second.wall).as_secs_f64(),
            stages: Stages::of(heard.timing.last()),
            stalled_host: runs.stalled,
            failures: runs.failures,
            damaged_model: runs.damage,
            all_streams: runs.streams,
            storm: runs.storm,
            restart: runs.restart,
            faults: Vec::new(),
        };
        figures.faults = figures.find_faults(input, expected, heard, &last);
        if boots.len() > 1 {
            let hellos = &boots[1].hellos;
            figures
                .faults
                .push(format!("it has reset itself: {hellos:?}"));
        }
        figures
    }

    /// The worst stage of the runs that go on to their end, over its deadline.
    pub(super) fn worst_over_deadline(&self) -> Option<f64> {
        [&self.stages, &self.all_streams.stages, &self.storm.stages]
            .into_iter()
            .filter_map(Stages::worst_over_deadline)
            .reduce(f64::max)
    }

    fn find_faults(
        &self,
        input: &Input,
        expected: &Heard,
        heard: &Heard,
        last: &Stats,
    ) -> Vec<String> {
        let zeros = [
            ("overruns", u64::from(self.overruns)),
            ("frames_dropped", self.frames_dropped.into()),
            ("frames_missing", self.frames_missing.into()),
            ("jitter_us", self.jitter_us),
        ];
        let mut faults: Vec<String> = zeros
            .iter()
            .filter(|(_, figure)| *figure != 0)
            .map(|(name, figure)| format!("{name} is {figure}, 0 allowed"))
            .collect();
        if let Some(why) = heard.first_damage {
            let damaged = self.frames_damaged;
            faults.push(format!("frames_damaged is {damaged}, the first: {why}"));
        }
        if !self.repeatable {
            faults.push("repeatable: a second run has sent other bytes".to_owned());
        }
        if self.different_codes > 0 {
            let what = first_difference(&codes(expected), &codes(heard));
            faults.push(format!("equal_to_host: {what}"));
        }
        if self.different_reports > 0 {
            let count = self.different_reports;
            faults.push(format!(
                "equal_to_host: {count} reports on electrodes differ"
            ));
        }
        let sound = Hello {
            board: BOARD.to_owned(),
            model_id: model::MODEL_ID,
            cause: ResetCause::PowerOn,
            fault: String::new(),
        };
        if heard.hellos != [sound] {
            faults.push(format!("it introduces itself as {:?}", heard.hellos));
        }
        if heard.capabilities != expected.capabilities {
            faults.push("its capabilities are not host-sim's".to_owned());
        }
        let (taken, all) = (self.samples, input.samples.len() as u64);
        if taken != all {
            faults.push(format!("samples is {taken} of {all}"));
        }
        // The counts go out with the reports, every second.
        if heard.stats.len() != heard.quality.len() || last.samples > all {
            faults.push(format!("{} Stats, the last: {last:?}", heard.stats.len()));
        }
        faults.extend(self.stages.faults());
        faults.extend(self.stalled_host.faults.iter().cloned());
        let failures = self.failures.iter().flat_map(|failure| &failure.faults);
        faults.extend(failures.cloned());
        faults.extend(self.damaged_model.faults.iter().cloned());
        faults.extend(self.all_streams.faults.iter().cloned());
        faults.extend(self.storm.faults.iter().cloned());
        faults.extend(self.restart.faults.iter().cloned());
        faults
    }
}

impl fmt::Display for MachineFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:12} {:12} {:>7} {:>10} {:>9} {:>5} us {:>9} {:>5.1} s",
            self.machine,
            self.core,
            self.codes,
            self.different_codes,
            self.overruns,
            self.jitter_us,
            self.bytes,
            self.wall_seconds
        )?;
        write!(f, "\n  {}", self.stages)?;
        for failure in &self.failures {
            write!(f, "\n  {failure}")?;
        }
        write!(f, "\n  {}\n  {}", self.damaged_model, self.stalled_host)?;
        write!(f, "\n  {}\n  {}", self.all_streams, self.storm)?;
        write!(f, "\n  {}", self.restart)
    }
}

/// What an image says at its end; what it does not say is 0, and missing samples are a fault.
#[derive(Debug, Default)]
pub(super) struct Said {
    pub(super) samples: u64,
    pub(super) overruns: u32,
}

impl Said {
    pub(super) fn of(lines: &[String]) -> Self {
        let number = |name| {
            let words = lines.iter().find_map(|line| line.strip_prefix(name));
            words.and_then(|number| number.trim().parse::<u64>().ok())
        };
        Self {
            samples: number("samples ").unwrap_or(0),
            overruns: u32::try_from(number("overruns ").unwrap_or(0)).unwrap_or(u32::MAX),
        }
    }
}

pub(super) fn codes(heard: &Heard) -> Vec<Code> {
    heard.codes.iter().map(|(_, code)| *code).collect()
}

/// Places at which both differ, or one has nothing.
pub(super) fn different<T: PartialEq>(expected: &[T], found: &[T]) -> usize {
    let pairs = expected.iter().zip(found);
    pairs.filter(|(expected, found)| expected != found).count()
        + expected.len().abs_diff(found.len())
}

/// The first code that is not the expected one.
fn first_difference(expected: &[Code], found: &[Code]) -> String {
    let mut pairs = expected.iter().zip(found);
    let Some((expected, found)) = pairs.find(|(expected, found)| expected != found) else {
        return format!("{} codes, {} expected", found.len(), expected.len());
    };
    let fields = [
        ("window", expected.window == found.window),
        ("first sample", expected.first_sample == found.first_sample),
        ("values", expected.values == found.values),
        ("flags", expected.flags == found.flags),
    ];
    let wrong = fields.iter().filter(|(_, equal)| !equal);
    let wrong: Vec<&str> = wrong.map(|(name, _)| *name).collect();
    let wrong = if wrong.is_empty() {
        "counts of clipped values and channels at the rail".to_owned()
    } else {
        wrong.join(", ")
    };
    format!("the code of window {} differs in {wrong}", expected.window)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::benchmark::emulator::MACHINES;
    use crate::qemu::{Run, host};

    /// Faults of a board that sends what host-sim does, after `break_it`. Its name, its counters, which
    /// host-sim sends at another moment, and its stages, which host-sim does not have, are left out.
    fn faults(break_it: impl Fn(&mut [Run; 2])) -> Vec<String> {
        let input = Input::make(40).expect("an input");
        let sent = host::sent(&input.samples).expect("host-sim");
        let expected = Heard::boots(&sent).swap_remove(0);
        let samples = input.samples.len();
        let run = || Run {
            sent: sent.clone(),
            said: vec![format!("samples {samples}"), "overruns 0".to_owned()],
            wall: Duration::from_secs(1),
        };
        let mut undisturbed = [run(), run()];
        break_it(&mut undisturbed);
        let runs = Runs {
            undisturbed,
            stalled: Stall::default(),
            failures: Vec::new(),
            damage: Damage::default(),
            streams: AllStreams::default(),
            storm: Storm::default(),
            restart: Restart::default(),
        };
        let figures = MachineFigures::new(MACHINES[0], runs, &input, &expected);
        let left_out = [
            "it introduces",
            "it has not said",
            "0 of 0 bytes of stack",
            "2 Stats",
        ];
        let faults = figures.faults.into_iter();
        faults
            .filter(|fault| !left_out.iter().any(|words| fault.starts_with(words)))
            .collect()
    }

    #[test]
    fn what_is_unequal_unrepeatable_overrun_or_lost_is_named() {
        assert_eq!(faults(|_| ()), [""; 0]);
        let found = faults(|runs| runs[1].said[1] = "overruns 2".to_owned());
        assert_eq!(found.len(), 2, "{found:?}");
        assert_eq!(found[0], "overruns is 2, 0 allowed");
        assert!(found[1].starts_with("repeatable"));
        let found = faults(|runs| runs[1].sent.truncate(1_000));
        assert_eq!(found, ["repeatable: a second run has sent other bytes"]);
        let found = faults(|runs| runs.iter_mut().for_each(|run| run.said.clear()));
        assert!(found[0].starts_with("samples is 0 of"), "{found:?}");
        // A byte within the first code: it is damaged, and so a number and a code are missing.
        let found = faults(|runs| runs.iter_mut().for_each(|run| run.sent[1_600] ^= 0x10));
        let words = [
            "frames_missing is 1",
            "frames_damaged is 1",
            "equal_to_host: ",
        ];
        for words in words {
            assert!(
                found.iter().any(|fault| fault.starts_with(words)),
                "{words}: {found:?}"
            );
        }
    }

    #[test]
    fn the_field_of_a_code_that_differs_is_named() {
        let input = Input::make(40).expect("an input");
        let sent = host::sent(&input.samples).expect("host-sim");
        let expected = codes(&Heard::boots(&sent)[0]);
        let mut found = expected.clone();
        found[7].flags = link::Flags::OVERRUN;
        found[7].first_sample += 1;
        assert_eq!(different(&expected, &found), 1);
        let what = first_difference(&expected, &found);
        assert_eq!(what, "the code of window 7 differs in first sample, flags");
        found.pop();
        assert_eq!(different(&expected, &found), 2);
        assert_eq!(
            first_difference(&expected, &expected[..39]),
            "39 codes, 40 expected"
        );
    }
}
