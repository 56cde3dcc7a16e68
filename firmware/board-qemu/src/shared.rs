//! State that the tasks and interrupts share.

use firmware::{Clock, Shared};

use crate::{registers::CLOCK_HZ, time_driver};

/// Shared state of the tasks. The free-running timer measures the durations of the stages.
pub(crate) static SHARED: Shared = Shared::new(Clock {
    now: time_driver::ticks,
    hz: CLOCK_HZ,
});
