//! The time type of ROS 1.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::Serialize;

use crate::wire::impl_wire;

const SECOND_NS: u64 = 1_000_000_000;

/// ROS 1 `time`: seconds and nanoseconds since 1970-01-01 UTC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Stamp {
    /// Whole seconds since 1970-01-01 UTC; overflows in 2106.
    pub secs: u32,
    /// Nanoseconds within the second, 0..=999,999,999.
    pub nsecs: u32,
}

impl_wire!(Stamp {
    secs: u32,
    nsecs: u32
});

impl Stamp {
    /// Converts nanoseconds since 1970-01-01 UTC. Times before 1970 or after 2106 are clamped to
    /// this range.
    pub fn from_nanoseconds(nanoseconds: i64) -> Stamp {
        let nanoseconds = u64::try_from(nanoseconds).unwrap_or(0);
        match u32::try_from(nanoseconds / SECOND_NS) {
            Ok(secs) => {
                let nsecs = (nanoseconds % SECOND_NS) as u32;
                Stamp { secs, nsecs }
            }
            Err(_) => Stamp {
                secs: u32::MAX,
                nsecs: 999_999_999,
            },
        }
    }

    /// Returns whether this is time 0, which in ROS means that the time is not known.
    pub fn is_unset(&self) -> bool {
        *self == Stamp::default()
    }

    /// Returns the current time of the host's wall clock.
    pub fn now() -> Stamp {
        let since = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or(Duration::ZERO);
        Stamp::from_nanoseconds(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
    }

    /// Converts to nanoseconds since 1970-01-01 UTC, 0..=4.3e18.
    pub fn nanoseconds(self) -> i64 {
        // At most 4,294,967,295.999,999,999 s = 4.3e18 ns, below 2^63 = 9.2e18.
        i64::from(self.secs) * 1_000_000_000 + i64::from(self.nsecs)
    }
}
