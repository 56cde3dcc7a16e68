//! Stamps that only go forwards.

use neuro_ros::Stamp;

use crate::streams::trigger::Trigger;
use crate::time::clock::Clock;
use crate::time::host_time::HostTime;

/// When something came, and what tells of the times before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reception<'a> {
    /// When it was read.
    pub(crate) read: HostTime,
    pub(crate) clock: &'a Clock,
    pub(crate) trigger: &'a Trigger,
}

/// Stamps that only go forwards, whatever the clocks do: each at least 1 us after the last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MonotoneStamps {
    last_ns: i64,
    moved: u64,
    /// Steps back of the wall clock that the stamps have followed.
    steps_back: u32,
}

impl MonotoneStamps {
    /// The stamp of a time on a wall clock that was stepped back `steps_back` times, each time too
    /// far to wait for it: after such a step a stamp may lie before the last.
    pub(crate) fn next(&mut self, nanoseconds: i64, steps_back: u32) -> Stamp {
        if std::mem::replace(&mut self.steps_back, steps_back) != steps_back {
            self.last_ns = 0;
        }
        let least = self.last_ns.saturating_add(1000);
        self.moved += u64::from(nanoseconds < least);
        self.last_ns = nanoseconds.max(least);
        Stamp::from_nanoseconds(self.last_ns)
    }

    /// Stamps that had to be moved forwards.
    pub(crate) fn moved(&self) -> u64 {
        self.moved
    }
}
