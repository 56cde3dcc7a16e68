//! The host's clocks, and the device's clock fitted to them.

pub(crate) mod clock;
mod fit;
pub(crate) mod round_trip;

use neuro_ros::Stamp;
use rustix::time::{ClockId, clock_gettime};

/// The monotonic clock. On Linux, it also runs while the host is suspended, as the device's clock
/// does.
#[cfg(target_os = "linux")]
const MONOTONIC: ClockId = ClockId::Boottime;
#[cfg(not(target_os = "linux"))]
const MONOTONIC: ClockId = ClockId::Monotonic;

/// Time on the host's monotonic clock and on its wall clock, read at the same instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTime {
    /// Time on the monotonic clock, which never steps, microseconds since the host was started.
    pub monotonic_us: i64,
    /// Time on the wall clock, nanoseconds since 1970. NTP or the user can step this clock.
    pub wall_ns: i64,
}

impl HostTime {
    /// Returns the present time on both clocks.
    pub fn now() -> HostTime {
        let monotonic = clock_gettime(MONOTONIC);
        HostTime {
            monotonic_us: monotonic.tv_sec * 1_000_000 + monotonic.tv_nsec / 1000,
            wall_ns: Stamp::now().nanoseconds(),
        }
    }

    /// Returns the wall-clock time minus the monotonic time, nanoseconds.
    pub(crate) fn wall_offset_ns(self) -> i64 {
        let monotonic_ns = self.monotonic_us.saturating_mul(1000);
        self.wall_ns.saturating_sub(monotonic_ns)
    }
}
