//! When the scheduled faults of a scenario begin and end.

use super::file::{FaultKind, Scenario, ScheduledFault};

/// Beginning or end of a fault.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// Host time, microseconds.
    pub(super) at_us: f64,
    pub(super) begins: bool,
    /// Index of the fault in the file, and index of this occurrence of the fault.
    pub(super) fault: usize,
    pub(super) occurrence: usize,
}

/// All beginnings and ends of the scheduled faults, in order of time.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    faults: Vec<ScheduledFault>,
    changes: std::vec::IntoIter<Change>,
    /// How often each fault has had an effect.
    pub(super) effects: Vec<u64>,
}

/// Shortest time from the end of a repeated fault to the end of the scenario, seconds.
const LEAST_REST_S: f64 = 5.0;

impl Schedule {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let faults: Vec<_> = scenario.faults.iter().map(|f| f.get_ref().clone()).collect();
        let mut changes = Vec::new();
        for (number, fault) in faults.iter().enumerate() {
            for occurrence in 0.. {
                #[expect(clippy::cast_precision_loss, reason = "far below 2^52 occurrences")]
                let at_s = fault.at_s + occurrence as f64 * fault.every_s.unwrap_or(0.0);
                let end_s = at_s + fault.for_s;
                if occurrence > 0 && end_s + LEAST_REST_S > scenario.duration_s {
                    break;
                }
                changes.extend([(at_s, true), (end_s, false)].map(|(s, begins)| Change {
                    at_us: s * 1e6,
                    begins,
                    fault: number,
                    occurrence,
                }));
                if fault.every_s.is_none() {
                    break;
                }
            }
        }
        changes.sort_by(|one, other| one.at_us.total_cmp(&other.at_us));
        Self { effects: vec![0; faults.len()], faults, changes: changes.into_iter() }
    }

    /// Returns the time of the next change, microseconds; infinite after the last one.
    pub(super) fn next_us(&self) -> f64 {
        let next = self.changes.as_slice().first();
        next.map_or(f64::INFINITY, |change| change.at_us)
    }

    pub(super) fn take(&mut self) -> Option<(Change, ScheduledFault)> {
        let change = self.changes.next()?;
        let fault = self.faults[change.fault].clone();
        Some((change, fault))
    }

    /// Returns kind and start of each fault that had no effect.
    pub(super) fn without_effect(&self) -> impl Iterator<Item = (FaultKind, f64)> {
        let faults = self.faults.iter().zip(&self.effects);
        let without = faults.filter(|(_, effects)| **effects == 0);
        without.map(|(fault, _)| (fault.kind, fault.at_s))
    }
}
