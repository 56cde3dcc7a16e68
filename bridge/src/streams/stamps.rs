//! Time stamps of published frames.

use neuro_ros::Stamp;

use crate::streams::trigger::Trigger;
use crate::time::clock::Clock;
use crate::time::host_time::HostTime;

/// Context in which a message is converted: when it was read, the fitted clock, the trigger input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reception<'a> {
    /// Host time at which the message was read.
    pub(crate) read: HostTime,
    pub(crate) clock: &'a Clock,
    pub(crate) trigger: &'a Trigger,
}

/// Stamps that increase by at least 1 us each, whatever the clocks do.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MonotoneStamps {
    last_ns: i64,
    moved: u64,
    /// Number of steps back of the wall clock that the stamps have followed.
    steps_back: u32,
}

impl MonotoneStamps {
    /// Returns the stamp for `nanoseconds` on the wall clock, moved forwards if it does not exceed
    /// the last stamp.
    ///
    /// `steps_back` counts the wall clock's long steps back ([`Clock::wall_steps_back`]). After
    /// such a step the stamp goes back with the clock.
    pub(crate) fn next(&mut self, nanoseconds: i64, steps_back: u32) -> Stamp {
        if std::mem::replace(&mut self.steps_back, steps_back) != steps_back {
            self.last_ns = 0;
        }
        let least = self.last_ns.saturating_add(1000);
        self.moved += u64::from(nanoseconds < least);
        self.last_ns = nanoseconds.max(least);
        Stamp::from_nanoseconds(self.last_ns)
    }

    /// Number of stamps that were moved forwards.
    pub(crate) fn moved(&self) -> u64 {
        self.moved
    }
}
