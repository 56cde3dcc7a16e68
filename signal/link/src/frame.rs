//! Header, limits and checksum of a frame.

use crc::{CRC_32_ISCSI, Crc, Digest};
use serde::{Deserialize, Serialize};

use crate::message::Message;

/// Version number of the layout of frame and header.
pub const VERSION: u8 = 1;

/// Length of the longest body (header, message and CRC, before COBS), bytes. With the largest
/// model, the longest body is an `Audit`, a window's int8 planes with its code: 5157 bytes (test
/// `samples_windows_and_self_tests_fit_a_frame`).
pub const MAX_BODY: usize = 5376;

/// Length of the longest frame, both zeros included, bytes.
pub const MAX_FRAME: usize = frame_bytes(MAX_BODY);

/// Returns the length of the longest frame with a body of `body` bytes, both zeros included.
pub const fn frame_bytes(body: usize) -> usize {
    cobs::max_encoding_length(body) + 2
}

/// Version, sequence number and device time; the first part of every frame's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// [`VERSION`] of the sender; the first byte of every frame's body.
    pub version: u8,
    /// Sequence number of the frame in its direction since boot; wraps at 2^32. A frame that is
    /// numbered and then dropped uses up a number too, so gaps in `seq` are exactly the lost
    /// frames.
    pub seq: u32,
    /// Sender's monotonic clock, microseconds since boot, range 0 to 2^64 - 1. A host sends 0,
    /// because no device reads its clock. In messages from a device it is the time of
    /// * [`Code`](crate::Code), [`PackedCode`](crate::PackedCode), [`Audit`](crate::Audit),
    ///   [`Filtered`](crate::Filtered), [`Features`](crate::Features): the last step
    /// * [`Raw`](crate::Raw), [`CompressedRaw`](crate::CompressedRaw),
    ///   [`Impedance`](crate::Impedance): the last sample's DRDY edge
    /// * [`Event`](crate::Event): the edge
    /// * [`Exclusion`](crate::Exclusion) after a change: the first step with the change
    /// * [`Quality`](crate::Quality), and `Stats`, `Timing` and `Exclusion` sent with it: the last
    ///   sample of the second
    /// * any other message: its creation
    pub device_time_us: u64,
}

/// Size of the CRC at the end of a body, bytes; it is sent least significant byte first.
pub(crate) const CRC_BYTES: usize = 4;

/// CRC-32C (Castagnoli); the crc crate names it CRC-32/ISCSI.
pub(crate) const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Returns a CRC that covers the direction byte, which is not sent; the caller adds the body.
pub(crate) fn digest<'m, M: Message<'m>>() -> Digest<'static, u32> {
    let mut digest = CRC.digest();
    digest.update(&[M::DIRECTION]);
    digest
}
