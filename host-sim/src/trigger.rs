//! A simulated trigger input.

use std::time::Duration;

use device::CapturedEvent;
use link::EventKind;
use thiserror::Error;

/// Shortest interval between edges that [`Trigger::every`] accepts.
const SHORTEST: Duration = Duration::from_millis(1);

/// A simulated trigger input: periodic edges, rising and falling in turn, at exact device times.
///
/// As on a board, edges are numbered from 0 at boot, and edges outside a run are counted as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trigger {
    /// Interval between edges, microseconds of device time.
    interval_us: u64,
    /// Device time of the boot, microseconds. Edge n occurs n + 1 intervals later.
    boot_us: u64,
    /// Number of edges since boot, which is the number of the next edge.
    edges: u64,
}

/// The interval between edges is shorter than a millisecond; holds the interval.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error(
    "an edge every {} us is too fast for a board; use an interval of a millisecond or more",
    .0.as_micros()
)]
pub struct TriggerError(Duration);

impl Trigger {
    /// Creates a trigger with an edge at every `interval`. The first edge occurs one interval after
    /// boot.
    ///
    /// # Errors
    /// [`TriggerError`] if the interval is shorter than a millisecond.
    pub fn every(interval: Duration) -> Result<Self, TriggerError> {
        let interval_us = u64::try_from(interval.as_micros()).unwrap_or(u64::MAX);
        if interval < SHORTEST {
            return Err(TriggerError(interval));
        }
        Ok(Self { interval_us, boot_us: 0, edges: 0 })
    }

    /// Restarts the trigger when the board boots at `now_us`: edges are numbered from 0 again.
    pub(crate) fn restart(&mut self, now_us: u64) {
        self.boot_us = now_us;
        self.edges = 0;
    }

    /// Skips the edges before the device time `start_us`. Later edges keep their numbers.
    pub(crate) fn skip_before(&mut self, start_us: u64) {
        let since_boot_us = start_us.saturating_sub(self.boot_us);
        self.edges = since_boot_us.saturating_sub(1) / self.interval_us;
    }

    /// Returns the next edge if it is not after `now_us`, microseconds of device time. Returns each
    /// edge once.
    pub(crate) fn next(&mut self, now_us: u64) -> Option<CapturedEvent> {
        let since_boot_us = (self.edges + 1).saturating_mul(self.interval_us);
        let at_us = self.boot_us.saturating_add(since_boot_us);
        if at_us > now_us {
            return None;
        }
        let kind = if self.edges.is_multiple_of(2) {
            EventKind::TriggerRise
        } else {
            EventKind::TriggerFall
        };
        #[expect(clippy::cast_possible_truncation, reason = "the number on the wire wraps")]
        let number = self.edges as u32;
        self.edges += 1;
        Some(CapturedEvent { kind, number, at_us })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_edges_keep_their_numbers_and_a_restart_counts_from_0() {
        let mut trigger = Trigger::every(Duration::from_secs(1)).expect("slow enough");
        trigger.skip_before(6_000_000);
        let next = trigger.next(6_000_000).expect("an edge");
        assert_eq!((next.number, next.at_us), (5, 6_000_000));
        assert_eq!(next.kind, EventKind::TriggerFall);
        trigger.skip_before(7_000_001);
        assert_eq!(trigger.next(7_999_999), None);
        trigger.restart(6_500_000);
        assert_eq!(trigger.next(7_499_999), None);
        let first = trigger.next(7_500_000).expect("an edge");
        assert_eq!((first.number, first.at_us), (0, 7_500_000));
    }

    #[test]
    fn an_interval_below_a_millisecond_is_refused() {
        let refused = Trigger::every(Duration::from_micros(999)).expect_err("too fast");
        assert!(refused.to_string().contains("999"), "{refused}");
    }
}
