//! State that the tasks and interrupts share.

use firmware::{Clock, Shared};

use crate::{registers::CLOCK_HZ, time_driver};

/// Shared state of the tasks; stages are timed with the free-running timer.
pub(crate) static SHARED: Shared = Shared::new(Clock {
    now: time_driver::ticks,
    hz: CLOCK_HZ,
});
