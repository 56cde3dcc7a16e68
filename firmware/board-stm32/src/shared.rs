//! State that the board's tasks and interrupts share.

use embassy_time::{Instant, TICK_HZ};
use firmware::{Clock, Shared};

/// Shared state of the tasks. The device's clock measures the durations of the stages, because the
/// core's cycle counter stops while the core sleeps.
pub(crate) static SHARED: Shared = Shared::new(Clock {
    now: ticks,
    #[expect(clippy::cast_possible_truncation, reason = "1 MHz")]
    hz: TICK_HZ as u32,
});

/// Returns the lower 32 bits of the device's clock, ticks of 1 us; wraps.
#[expect(clippy::cast_possible_truncation, reason = "it wraps")]
fn ticks() -> u32 {
    Instant::now().as_ticks() as u32
}
