//! Times on the host's monotonic clock and wall clock.

use std::sync::OnceLock;
use std::time::Instant;

use neuro_ros::Stamp;

/// A reading of the host's monotonic clock and wall clock at the same instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTime {
    /// Time on the monotonic clock, microseconds since its first reading in this process; never
    /// steps.
    pub monotonic_us: i64,
    /// Time on the wall clock, nanoseconds since 1970; NTP or the user can step it.
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

    /// Wall clock minus monotonic clock, nanoseconds.
    pub(crate) fn wall_offset_ns(self) -> i64 {
        let monotonic_ns = self.monotonic_us.saturating_mul(1000);
        self.wall_ns.saturating_sub(monotonic_ns)
    }
}
