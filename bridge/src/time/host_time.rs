//! Readings of the host's monotonic clock and wall clock.

use std::sync::OnceLock;
use std::time::Instant;

use neuro_ros::Stamp;

/// The time on the host's monotonic clock and on its wall clock, read at the same instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTime {
    /// Time on the monotonic clock, which never steps; microseconds since this process first read
    /// it.
    pub monotonic_us: i64,
    /// Time on the wall clock, nanoseconds since 1970. NTP or the user can step this clock.
    pub wall_ns: i64,
}

impl HostTime {
    /// Reads the monotonic clock and then the wall clock.
    pub fn now() -> HostTime {
        static START: OnceLock<Instant> = OnceLock::new();
        let since = START.get_or_init(Instant::now).elapsed();
        let monotonic_us = i64::try_from(since.as_micros()).unwrap_or(i64::MAX);
        HostTime {
            monotonic_us,
            wall_ns: Stamp::now().nanoseconds(),
        }
    }

    /// Returns the wall-clock time minus the monotonic time, nanoseconds.
    pub(crate) fn wall_offset_ns(self) -> i64 {
        let monotonic_ns = self.monotonic_us.saturating_mul(1000);
        self.wall_ns.saturating_sub(monotonic_ns)
    }
}
