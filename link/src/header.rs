//! What precedes every message.

use serde::{Deserialize, Serialize};

/// Version of frame and header that this crate speaks.
pub const VERSION: u8 = 1;

/// What precedes every message: version, sequence number, device time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Version of frame and header, [`VERSION`]; the first byte of every frame's body.
    pub version: u8,
    /// Number of the frame in its direction since boot; wraps at 2^32. Frames that were made and
    /// then dropped before sending have one too, so that a gap is a loss and the ledger closes.
    pub seq: u32,
    /// Time on the sender's monotonic clock, microseconds since boot, range 0 to 2^64 - 1. In a
    /// [`Code`](crate::Code): the DRDY edge of the last ADC sample of its window. Elsewhere: when
    /// the message was made. A host, whose clock nobody reads, sends 0.
    pub device_time_us: u64,
}
