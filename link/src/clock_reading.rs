//! The device's clock beside the host's.

use serde::{Deserialize, Serialize};

/// The answer to `SyncTime`, before its `Ack`: two of the four times that tell how long a frame was
/// under way; the header has the third, the host keeps the fourth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClockReading {
    /// What the host sent, microseconds on the host's clock.
    pub host_time_us: u64,
    /// When the command was read, microseconds since boot.
    pub received_us: u64,
}
