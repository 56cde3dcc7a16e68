//! The host's two clocks, read together.

use std::sync::OnceLock;
use std::time::Instant;

use neuro_ros::Stamp;

/// The host's two clocks, read together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTime {
    /// Monotonic, microseconds since the program began; never steps.
    pub monotonic_us: i64,
    /// Wall clock, nanoseconds since 1970; can be stepped by NTP or by hand.
    pub wall_ns: i64,
}

impl HostTime {
    /// Both clocks now.
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
