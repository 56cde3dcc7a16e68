//! A trigger that nobody wired.

use std::time::Duration;

use device::Captured;
use link::EventKind;
use thiserror::Error;

/// Shortest time between two edges.
const SHORTEST: Duration = Duration::from_millis(1);

/// A made-up trigger input: an edge every so often, high and low in turn, at exact device times.
///
/// Edges have numbers since boot, whether anything streams or not, as those of a board's input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trigger {
    /// From one edge to the next, microseconds of device time.
    every_us: u64,
    /// Device time of the boot, microseconds; edge n comes n + 1 times `every_us` later.
    boot_us: u64,
    /// Edges since boot.
    edges: u64,
}

/// Edges that would come too fast.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("edges every {0:?} are too many; a millisecond is the least")]
pub struct TriggerError(Duration);

impl Trigger {
    /// An edge every so often, the first one so long after power-on.
    ///
    /// # Errors
    /// [`TriggerError`]: less than a millisecond.
    pub fn every(every: Duration) -> Result<Self, TriggerError> {
        let every_us = u64::try_from(every.as_micros()).unwrap_or(u64::MAX);
        if every < SHORTEST {
            return Err(TriggerError(every));
        }
        Ok(Self {
            every_us,
            boot_us: 0,
            edges: 0,
        })
    }

    /// The board starts anew: edges are counted from 0 again.
    pub(crate) fn restart(&mut self, now_us: u64) {
        self.boot_us = now_us;
        self.edges = 0;
    }

    /// What has happened before `begin_us` has its number and is told to nobody.
    pub(crate) fn forget_before(&mut self, begin_us: u64) {
        let since_boot_us = begin_us.saturating_sub(self.boot_us);
        self.edges = since_boot_us.saturating_sub(1) / self.every_us;
    }

    /// The next edge that came until `now_us`, device time in microseconds; each once.
    pub(crate) fn next(&mut self, now_us: u64) -> Option<Captured> {
        let since_boot_us = (self.edges + 1).saturating_mul(self.every_us);
        let at_us = self.boot_us.saturating_add(since_boot_us);
        if at_us > now_us {
            return None;
        }
        let kind = if self.edges.is_multiple_of(2) {
            EventKind::TriggerRise
        } else {
            EventKind::TriggerFall
        };
        #[expect(clippy::cast_possible_truncation, reason = "the wire's number wraps")]
        let number = self.edges as u32;
        self.edges += 1;
        Some(Captured {
            kind,
            number,
            at_us,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_rise_and_fall_in_turn_at_exact_times() {
        let mut trigger = Trigger::every(Duration::from_millis(250)).expect("slow enough");
        let edges: Vec<_> = std::iter::from_fn(|| trigger.next(750_000)).collect();
        let edge = |kind, number, at_us| Captured {
            kind,
            number,
            at_us,
        };
        assert_eq!(
            edges,
            [
                edge(EventKind::TriggerRise, 0, 250_000),
                edge(EventKind::TriggerFall, 1, 500_000),
                edge(EventKind::TriggerRise, 2, 750_000),
            ]
        );
    }

    #[test]
    fn what_nobody_is_told_of_keeps_its_number_and_a_boot_begins_anew() {
        let mut trigger = Trigger::every(Duration::from_secs(1)).expect("slow enough");
        trigger.forget_before(6_000_000);
        let next = trigger.next(6_000_000).expect("an edge");
        assert_eq!((next.number, next.at_us), (5, 6_000_000));
        assert_eq!(next.kind, EventKind::TriggerFall);
        trigger.forget_before(7_000_001);
        assert_eq!(trigger.next(7_999_999), None);
        trigger.restart(6_500_000);
        assert_eq!(trigger.next(7_499_999), None);
        let first = trigger.next(7_500_000).expect("an edge");
        assert_eq!((first.number, first.at_us), (0, 7_500_000));
    }

    #[test]
    fn edges_that_no_board_could_take_are_refused() {
        let refused = Trigger::every(Duration::from_micros(999)).expect_err("too many");
        assert!(refused.to_string().contains("999"), "{refused}");
    }
}
