//! Delays for the converters' driver.

use embassy_time::{Duration, Timer, block_for};
use embedded_hal_async::delay::DelayNs;

/// Longest delay during which the core is kept busy, microseconds. Setting an alarm takes about as
/// long.
const SHORT_US: u32 = 10;

/// Delays that are at least as long as requested.
pub(crate) struct Delay;

impl DelayNs for Delay {
    async fn delay_ns(&mut self, ns: u32) {
        self.delay_us(ns.div_ceil(1_000)).await;
    }

    async fn delay_us(&mut self, us: u32) {
        // Add one microsecond, because part of the current microsecond has already passed.
        let wait = Duration::from_micros(u64::from(us) + 1);
        if us <= SHORT_US {
            block_for(wait);
        } else {
            Timer::after(wait).await;
        }
    }
}
