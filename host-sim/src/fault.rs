//! Scheduled faults of converters and electrodes.

use std::str::FromStr;

use ads1299::{Register, simulation};
use device::CHIPS;
use thiserror::Error;

/// Returns the syntax and kinds of faults, as `--help` prints them, for the model's converters.
pub fn help() -> String {
    help_for(CHIPS, model::LABELS)
}

/// Returns the help for a board with this number of chips, and electrodes whose `labels` are
/// separated by blanks.
fn help_for(chips: usize, labels: &str) -> String {
    let electrode = labels.split(' ').next().unwrap_or_default();
    let numbers = match chips {
        1 => "There is one chip, chip0; its DRDY is wired.".to_owned(),
        _ => format!("Chips count from 0 to {}; chip 0 is the one whose DRDY is wired.", chips - 1),
    };
    format!(
        "\
KIND[@FROM[..TO]]:WHERE, such as dead@3s:chip0, stuck@2s..4.5s:chip0, lead-off@2s:{electrode}.
FROM and TO are seconds of signal since power-on; without FROM the fault is present at power-on, without
TO it stays. {numbers} Kinds:
  dead          no power; it also blocks the data of the chips that are daisy-chained through it
  stuck         repeats its last sample
  wrong-id      its ID is that of another part; detected at power-on and by the self-test
  forgets       CH1SET ignores what is written; detected at power-on and by the self-test
  double-rate   converts twice as fast; chip 0 only
  missed-drdy   one edge of DRDY is missing; chip 0 only, without TO
  wrong-status  its status word does not begin with 1100
  shifted-bit   its data, and that of the chips daisy-chained through it, is one bit late
  lead-off      an electrode comes off; WHERE is its label"
    )
}

/// A fault of a converter or an electrode, with its start and end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The change of the simulated chain that begins the fault, and the change that repairs it.
    changes: (Change, Change),
    /// Index of the first ADC sample with the fault, counted from power-on; 0 if the fault is
    /// present before the chain is initialised.
    from: u64,
    /// Index of the first ADC sample after the repair, counted from power-on; `None` if the fault
    /// is never repaired.
    to: Option<u64>,
}

/// Why a text is not a fault, or why two faults cannot be combined.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FaultError {
    /// The text has no colon, so it does not say where the fault is; holds the text.
    #[error("'{0}' names no place; write KIND@FROM:WHERE, such as dead@3s:chip0")]
    NoPlace(String),
    /// The word before `@` or `:` is not a kind of fault; holds the word.
    #[error("'{0}' is no kind of fault; the kinds are {KINDS}")]
    NoKind(String),
    /// The fault needs a chip, but the model has no chip of this name; holds the name.
    #[error("'{0}' is no chip; write chip0 or another below chip{CHIPS}")]
    NoChip(String),
    /// The text after the colon of a `lead-off` is not an electrode of the model; holds that text.
    #[error("'{0}' is no electrode of the model; its electrodes are {labels}", labels = model::LABELS)]
    NoElectrode(String),
    /// FROM or TO is negative or not a number of seconds; holds the text of that time.
    #[error("'{0}' is no time; write seconds, such as 3s or 0.5s")]
    NoTime(String),
    /// TO is not after FROM; holds the whole text.
    #[error("'{0}' ends before it begins; write FROM before TO")]
    Backwards(String),
    /// The fault affects DRDY but is not on chip 0, the only chip whose DRDY is wired; holds the
    /// kind.
    #[error("{0} affects DRDY, and only that of chip0 is wired; write chip0")]
    NotWired(String),
    /// The text states an end (TO) for `missed-drdy`, which always ends after one sample.
    #[error("a missed edge of DRDY ends by itself; omit ..TO")]
    Passing,
    /// Two faults of one chip overlap in time; holds the number of the chip.
    #[error(
        "chip{0} has two faults at the same time; the simulated chip breaks in one way at a time"
    )]
    Twice(usize),
}

const KINDS: &str = "dead, stuck, wrong-id, forgets, double-rate, missed-drdy, wrong-status, \
                     shifted-bit and lead-off";

impl FromStr for Fault {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let no_place = || FaultError::NoPlace(text.to_owned());
        let (what, place) = text.split_once(':').ok_or_else(no_place)?;
        let (name, times) = match what.split_once('@') {
            Some((name, times)) => (name, Some(times)),
            None => (what, None),
        };
        let changes = changes(name, place)?;
        let (from, to) = match times {
            None => (0, None),
            Some(times) => match times.split_once("..") {
                None => (samples(times)?, None),
                Some((from, to)) => (samples(from)?, Some(samples(to)?)),
            },
        };
        if to.is_some_and(|to| to <= from) {
            return Err(FaultError::Backwards(text.to_owned()));
        }
        let passes = changes.0 == Change::Inject(0, simulation::Fault::MissedReady);
        if passes && to.is_some() {
            return Err(FaultError::Passing);
        }
        // A missed edge affects one sample, so the fault is repaired at the next sample.
        let to = if passes { Some(from + 1) } else { to };
        Ok(Self { changes, from, to })
    }
}

#[cfg(feature = "program")]
impl Fault {
    /// Returns the time at which the fault begins, seconds of signal since power-on.
    pub(crate) fn start_s(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "far below 2^52 samples")]
        let samples = self.from as f64;
        samples / f64::from(model::ADC_RATE_HZ)
    }

    /// Returns whether the fault doubles the number of samples that the driver reads in a period.
    pub(crate) fn doubles_rate(&self) -> bool {
        self.changes.0 == Change::Inject(0, simulation::Fault::DoubleRate)
    }
}

/// Returns the change of the chain that causes the fault `name` at the chip or electrode `place`,
/// and the change that repairs it.
fn changes(name: &str, place: &str) -> Result<(Change, Change), FaultError> {
    use simulation::Fault as Broken;
    let broken = match name {
        "dead" => Broken::Dead,
        "stuck" => Broken::StuckData,
        // Content of the ID register of an ADS1298, a chip of another type.
        "wrong-id" => Broken::WrongId(0x92),
        "forgets" => Broken::Forgets(Register::CH1SET),
        "double-rate" => Broken::DoubleRate,
        "missed-drdy" => Broken::MissedReady,
        "wrong-status" => Broken::WrongNibble(0b0101),
        "shifted-bit" => Broken::ShiftedBit,
        "lead-off" => {
            let mut labels = model::LABELS.split(' ');
            let electrode = labels.position(|label| label.eq_ignore_ascii_case(place));
            let none = || FaultError::NoElectrode(place.to_owned());
            let channel = electrode.ok_or_else(none)?;
            let [off, on] = [false, true].map(|on| Change::Electrode { channel, on });
            return Ok((off, on));
        }
        _ => return Err(FaultError::NoKind(name.to_owned())),
    };
    let number = place.strip_prefix("chip").and_then(|n| n.parse().ok());
    let chip = number.filter(|chip| *chip < CHIPS);
    let chip = chip.ok_or_else(|| FaultError::NoChip(place.to_owned()))?;
    if chip > 0 && matches!(broken, Broken::DoubleRate | Broken::MissedReady) {
        return Err(FaultError::NotWired(name.to_owned()));
    }
    Ok((Change::Inject(chip, broken), Change::Repair(chip)))
}

/// Parses a time in seconds and returns the number of ADC samples before it.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "not negative; beyond 2^64 samples it saturates"
)]
fn samples(text: &str) -> Result<u64, FaultError> {
    let seconds: Option<f64> = text.strip_suffix('s').unwrap_or(text).parse().ok();
    let seconds = seconds.filter(|s| s.is_finite() && *s >= 0.0);
    let seconds = seconds.ok_or_else(|| FaultError::NoTime(text.to_owned()))?;
    Ok((seconds * f64::from(model::ADC_RATE_HZ)).round() as u64)
}

/// A change of the simulated chain, which begins or ends a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Inject(usize, simulation::Fault),
    Repair(usize),
    Electrode { channel: usize, on: bool },
}

/// Schedule of the faults of a run; the default has none.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Pairs (samples before the change, change), in order of time. At equal times, the repair of a
    /// chip precedes a new fault.
    changes: Vec<(u64, Change)>,
    /// Number of changes that [`Faults::take_due`] has already returned.
    applied: usize,
}

impl Faults {
    /// Creates the schedule of `faults`.
    ///
    /// # Errors
    /// [`FaultError::Twice`] if two faults of one chip overlap in time.
    pub fn new(faults: &[Fault]) -> Result<Self, FaultError> {
        let mut changes = Vec::new();
        for (index, fault) in faults.iter().enumerate() {
            let (broken, repaired) = fault.changes;
            if let Change::Repair(chip) = repaired
                && faults[..index].iter().any(|other| fault.overlaps(other))
            {
                return Err(FaultError::Twice(chip));
            }
            changes.push((fault.from, broken));
            changes.extend(fault.to.map(|to| (to, repaired)));
        }
        changes.sort_by_key(|(time, change)| (*time, matches!(change, Change::Inject(..))));
        let applied = 0;
        Ok(Self { changes, applied })
    }

    /// Returns the changes that are due after `samples` samples and were not returned before.
    pub(crate) fn take_due(&mut self, samples: u64) -> Vec<Change> {
        let due = self.changes[self.applied..].iter();
        let due: Vec<Change> =
            due.take_while(|(time, _)| *time <= samples).map(|(_, change)| *change).collect();
        self.applied += due.len();
        due
    }
}

impl Fault {
    /// Returns true if both faults affect the same chip, or electrode, at the same time.
    fn overlaps(&self, other: &Self) -> bool {
        let ends = |fault: &Self| fault.to.unwrap_or(u64::MAX);
        let repaired = |fault: &Self| fault.changes.1;
        repaired(self) == repaired(other) && self.from < ends(other) && other.from < ends(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_parsed_with_its_times_and_place() {
        let rate = u64::from(model::ADC_RATE_HZ);
        let dead: Fault = "dead@3s..6.5s:chip2".parse().expect("a fault");
        assert_eq!((dead.from, dead.to), (3 * rate, Some(13 * rate / 2)));
        assert_eq!(dead.changes.0, Change::Inject(2, simulation::Fault::Dead));
        let (_, second) = model::LABELS.split_once(' ').expect("many electrodes");
        let label = second.split(' ').next().expect("a label").to_lowercase();
        let off: Fault = format!("lead-off@2:{label}").parse().expect("a fault");
        let (channel, on) = (1, false);
        assert_eq!(off.changes.0, Change::Electrode { channel, on });
        let id: Fault = "wrong-id:chip7".parse().expect("a fault");
        assert_eq!((id.from, id.to), (0, None));
    }

    #[test]
    fn the_help_names_the_chips_and_an_electrode_of_the_model() {
        assert!(help_for(2, "Fp1 Fp2").contains("from 0 to 1; chip 0"));
        assert!(help_for(2, "Fp1 Fp2").contains("lead-off@2s:Fp1."));
        assert!(help_for(1, "Fp1").contains("one chip, chip0"));
        let help = help();
        let examples = help.lines().next().expect("a line").split_once("such as ");
        let (_, examples) = examples.expect("examples");
        for example in examples.trim_end_matches('.').split(", ") {
            let fault: Result<Fault, FaultError> = example.parse();
            assert!(fault.is_ok(), "{example} is no fault of this model");
        }
    }

    #[test]
    fn a_text_that_is_no_fault_is_refused_with_a_remedy() {
        let beyond = format!("chip{CHIPS}");
        for (text, part) in [
            ("dead@3s", "dead@3s:chip0"),
            ("smoke:chip1", "shifted-bit"),
            (&format!("dead:{beyond}"), &format!("below {beyond}")),
            ("lead-off:Fp99", model::LABELS),
            ("dead@soon:chip1", "0.5s"),
            ("dead@3s..2s:chip1", "before it begins"),
            ("double-rate@1s:chip1", "only that of chip0"),
            ("missed-drdy@1s..2s:chip0", "by itself"),
        ] {
            let error = text.parse::<Fault>().expect_err(text).to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn faults_of_a_chip_must_not_overlap() {
        let faults = |texts: &[&str]| {
            let faults: Vec<Fault> = texts.iter().map(|t| t.parse().expect("a fault")).collect();
            Faults::new(&faults)
        };
        let twice = faults(&["dead@1s:chip1", "stuck@3s:chip1"]).expect_err("two at once");
        assert_eq!(twice, FaultError::Twice(1));
        let mut fine = faults(&["stuck@2s:chip1", "dead@1s..2s:chip1"]).expect("one by one");
        let second = u64::from(model::ADC_RATE_HZ);
        assert_eq!(fine.take_due(second - 1), []);
        assert_eq!(fine.take_due(second), [Change::Inject(1, simulation::Fault::Dead)]);
        let stuck = Change::Inject(1, simulation::Fault::StuckData);
        assert_eq!(fine.take_due(2 * second), [Change::Repair(1), stuck]);
        assert_eq!(fine.take_due(3 * second), []);
    }
}
