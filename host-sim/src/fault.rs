//! What is to break, and when.

use std::str::FromStr;

use ads1299::{Register, simulation};
use thiserror::Error;

use crate::CHIPS;

/// The names, and what each does; the text of `--help`.
pub const FAULTS: &str = "\
What can break: KIND[@FROM[..TO]]:WHERE, such as dead@3s:chip2, stuck@2s..4.5s:chip0, lead-off@2s:Cz.
FROM and TO are seconds of signal since power-on; without FROM it is broken from the beginning, without
TO it stays so. Chips count from 0 to 7; chip 0 is the one whose DRDY is wired. Kinds:
  dead          no power; what the chips behind it send does not get past it
  stuck         sends its last sample for ever
  wrong-id      says to be another part; seen at power-on and by the self-test
  forgets       CH1SET keeps its value; seen at power-on and by the self-test
  double-rate   converts twice as fast; chip 0 only
  missed-drdy   one edge of DRDY does not come; chip 0 only, without TO
  wrong-status  its status does not begin with 1100
  shifted-bit   it and the chips behind it come a bit late
  lead-off      an electrode comes off; WHERE is its label";

/// What happens to a chip or an electrode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Chip(usize, simulation::Fault),
    /// ADC channel.
    Electrode(usize),
}

/// Something that breaks at a time, and may be mended at another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    kind: Kind,
    /// Samples before it; 0 is before the chain is brought up.
    from: u64,
    /// Samples before it is mended.
    to: Option<u64>,
}

/// Why a fault is none.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FaultError {
    /// No place.
    #[error("{0:?} does not say where; write KIND@FROM:WHERE, such as dead@3s:chip2")]
    NoPlace(String),
    /// Not one of the kinds.
    #[error("{0:?} cannot break; there are {KINDS}")]
    NoKind(String),
    /// Not a chip.
    #[error("{0:?} is no chip; there are chip0 to chip7")]
    NoChip(String),
    /// Not an electrode of the model.
    #[error("{0:?} is no electrode of the model; there are {labels}", labels = model::LABELS)]
    NoElectrode(String),
    /// Not a time.
    #[error("{0:?} is no time; write seconds, such as 3s or 0.5s")]
    NoTime(String),
    /// Ends before it begins.
    #[error("{0:?} ends before it begins")]
    Backwards(String),
    /// Only chip 0's DRDY is wired.
    #[error("{0} shows at DRDY, and only that of chip0 is wired")]
    NotWired(String),
    /// Cannot be mended.
    #[error("a missed edge of DRDY is over by itself; leave ..TO out")]
    Passing,
    /// Two at once.
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
        let kind = kind(name, place)?;
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
        let passes = kind == Kind::Chip(0, simulation::Fault::MissedReady);
        if passes && to.is_some() {
            return Err(FaultError::Passing);
        }
        // It is over with the sample that it takes.
        let to = if passes { Some(from + 1) } else { to };
        Ok(Self { kind, from, to })
    }
}

fn kind(name: &str, place: &str) -> Result<Kind, FaultError> {
    use simulation::Fault as Broken;
    let broken = match name {
        "dead" => Broken::Dead,
        "stuck" => Broken::StuckData,
        // An ADS1298.
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
            return electrode.map(Kind::Electrode).ok_or_else(none);
        }
        _ => return Err(FaultError::NoKind(name.to_owned())),
    };
    let number = place.strip_prefix("chip").and_then(|n| n.parse().ok());
    let chip = number.filter(|chip| *chip < CHIPS);
    let chip = chip.ok_or_else(|| FaultError::NoChip(place.to_owned()))?;
    if chip > 0 && matches!(broken, Broken::DoubleRate | Broken::MissedReady) {
        return Err(FaultError::NotWired(name.to_owned()));
    }
    Ok(Kind::Chip(chip, broken))
}

/// Samples of the ADC before a time in seconds.
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

/// What breaks or is mended at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Break(usize, simulation::Fault),
    Mend(usize),
    Electrode { channel: usize, on: bool },
}

/// All that is to break.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// By time; what is mended comes before what breaks at the same time.
    changes: Vec<(u64, Change)>,
    /// How many of them have been made.
    made: usize,
}

impl Faults {
    /// Nothing breaks.
    pub const NONE: Self = Self {
        changes: Vec::new(),
        made: 0,
    };

    /// All of these.
    ///
    /// # Errors
    /// [`FaultError::Twice`].
    pub fn new(faults: &[Fault]) -> Result<Self, FaultError> {
        let mut changes = Vec::new();
        for (index, fault) in faults.iter().enumerate() {
            if let Kind::Chip(chip, _) = fault.kind
                && faults[..index].iter().any(|other| fault.meets(other))
            {
                return Err(FaultError::Twice(chip));
            }
            let (broken, mended) = match fault.kind {
                Kind::Chip(chip, fault) => (Change::Break(chip, fault), Change::Mend(chip)),
                Kind::Electrode(channel) => (
                    Change::Electrode { channel, on: false },
                    Change::Electrode { channel, on: true },
                ),
            };
            changes.push((fault.from, broken));
            changes.extend(fault.to.map(|to| (to, mended)));
        }
        changes.sort_by_key(|(time, change)| (*time, matches!(change, Change::Break(..))));
        Ok(Self { changes, made: 0 })
    }

    /// What happens once so many samples have been taken, and has not been told yet.
    pub(crate) fn at(&mut self, samples: u64) -> Vec<Change> {
        let due = self.changes[self.made..].iter();
        let due: Vec<Change> = due
            .take_while(|(time, _)| *time <= samples)
            .map(|(_, change)| *change)
            .collect();
        self.made += due.len();
        due
    }
}

impl Fault {
    /// Whether both are at the same chip at the same time.
    fn meets(&self, other: &Self) -> bool {
        let same = match (self.kind, other.kind) {
            (Kind::Chip(one, _), Kind::Chip(two, _)) => one == two,
            _ => false,
        };
        let ends = |fault: &Self| fault.to.unwrap_or(u64::MAX);
        same && self.from < ends(other) && other.from < ends(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        let error: FaultError = text.parse::<Fault>().expect_err("not a fault");
        error.to_string()
    }

    #[test]
    fn faults_are_read_with_their_times_and_places() {
        let rate = u64::from(model::ADC_RATE_HZ);
        let dead: Fault = "dead@3s..6.5s:chip2".parse().expect("a fault");
        assert_eq!((dead.from, dead.to), (3 * rate, Some(13 * rate / 2)));
        assert_eq!(dead.kind, Kind::Chip(2, simulation::Fault::Dead));
        let (_, second) = model::LABELS.split_once(' ').expect("many electrodes");
        let label = second.split(' ').next().expect("a label").to_lowercase();
        let off: Fault = format!("lead-off@2:{label}").parse().expect("a fault");
        assert_eq!(off.kind, Kind::Electrode(1));
        let id: Fault = "wrong-id:chip7".parse().expect("a fault");
        assert_eq!((id.from, id.to), (0, None));
    }

    #[test]
    fn what_is_no_fault_is_refused_with_what_to_write_instead() {
        assert!(error("dead@3s").contains("dead@3s:chip2"));
        assert!(error("smoke:chip1").contains("shifted-bit"));
        assert!(error("dead:chip8").contains("chip0 to chip7"));
        assert!(error("lead-off:Fp99").contains(model::LABELS));
        assert!(error("dead@soon:chip1").contains("0.5s"));
        assert!(error("dead@3s..2s:chip1").contains("before it begins"));
        assert!(error("double-rate@1s:chip1").contains("only that of chip0"));
        assert!(error("missed-drdy@1s..2s:chip0").contains("by itself"));
    }

    #[test]
    fn a_chip_breaks_in_one_way_at_a_time() {
        let faults = |texts: &[&str]| {
            let faults: Vec<Fault> = texts.iter().map(|t| t.parse().expect("a fault")).collect();
            Faults::new(&faults)
        };
        let twice = faults(&["dead@1s:chip1", "stuck@3s:chip1"]).expect_err("two at once");
        assert_eq!(twice, FaultError::Twice(1));
        let mut fine = faults(&["stuck@2s:chip1", "dead@1s..2s:chip1"]).expect("one by one");
        let second = u64::from(model::ADC_RATE_HZ);
        assert_eq!(fine.at(second - 1), []);
        assert_eq!(fine.at(second), [Change::Break(1, simulation::Fault::Dead)]);
        let then = [
            Change::Mend(1),
            Change::Break(1, simulation::Fault::StuckData),
        ];
        assert_eq!(fine.at(2 * second), then);
        assert_eq!(fine.at(3 * second), []);
    }
}
