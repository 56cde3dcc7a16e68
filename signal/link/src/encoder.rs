//! Numbers messages and encodes them into frames.

use core::fmt;

use cobs::CobsEncoder;
use crc::Digest;
use postcard::ser_flavors::Flavor;
use serde::Serialize as _;

use crate::frame::{CRC_BYTES, Header, MAX_BODY, MAX_FRAME, VERSION, digest};
use crate::message::Message;

/// A frame does not fit: the buffer is too short, or the body would exceed [`MAX_BODY`]. Pass
/// [`encode`] a buffer of [`MAX_FRAME`] bytes and keep texts within their limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncodeError {
    /// Length of the buffer that was passed, bytes.
    pub buffer: usize,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "the frame does not fit the buffer of {} bytes or its body exceeds {MAX_BODY} bytes; \
             use a buffer of {MAX_FRAME} bytes and shorten labels and texts",
            self.buffer
        )
    }
}

impl core::error::Error for EncodeError {}

/// Writes one frame into `out`, both zeros included, and returns the part written.
///
/// One pass without a scratch buffer: each byte from postcard goes straight through CRC and COBS.
///
/// # Errors
///
/// [`EncodeError`] if the frame does not fit `out` ([`MAX_FRAME`] always suffices for messages
/// within their limits).
pub fn encode<'m, 'b, M: Message<'m>>(
    header: &Header,
    message: &M,
    out: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let error = EncodeError { buffer: out.len() };
    let written = {
        let inner_end = out.len().checked_sub(1).ok_or(error)?;
        let inner = out.get_mut(1..inner_end).ok_or(error)?;
        let sink =
            FrameWriter { encoder: CobsEncoder::new(inner), digest: digest::<M>(), room: MAX_BODY };
        write(header, message, sink).map_err(|_| error)?
    };
    out[0] = 0;
    out[1 + written] = 0;
    Ok(&out[..written + 2])
}

/// Writes header, fields and tail of a message; returns the number of bytes written.
fn write<'m, M: Message<'m>>(
    header: &Header,
    message: &M,
    sink: FrameWriter<'_>,
) -> postcard::Result<usize> {
    let mut serializer = postcard::Serializer { output: sink };
    (header, message).serialize(&mut serializer)?;
    serializer.output.try_extend(message.tail())?;
    serializer.output.finalize()
}

/// Writes the frames of one direction and numbers them; a sender has one encoder.
#[derive(Clone, Debug, Default)]
pub struct Encoder {
    next_seq: u32,
}

impl Encoder {
    /// Creates an encoder whose first frame has `seq`.
    pub const fn starting_at(seq: u32) -> Encoder {
        Encoder { next_seq: seq }
    }

    /// Returns the `seq` that the next frame will have.
    pub const fn next_seq(&self) -> u32 {
        self.next_seq
    }

    /// Numbers a frame and writes it into `out`. If the caller then drops the frame, the number is
    /// still used up.
    ///
    /// # Errors
    ///
    /// As [`encode`]. A failed call uses up the number too, so that the receiver notices the loss.
    pub fn encode<'m, 'b, M: Message<'m>>(
        &mut self,
        device_time_us: u64,
        message: &M,
        out: &'b mut [u8],
    ) -> Result<&'b [u8], EncodeError> {
        encode(&self.number(device_time_us), message, out)
    }

    /// Uses up the number of a frame that is never written, so that the receiver notices the loss.
    pub fn skip(&mut self) {
        self.number(0);
    }

    fn number(&mut self, device_time_us: u64) -> Header {
        let header = Header { version: VERSION, seq: self.next_seq, device_time_us };
        self.next_seq = self.next_seq.wrapping_add(1);
        header
    }
}

/// Receives postcard's bytes, adds them to the CRC and writes them as COBS.
struct FrameWriter<'b> {
    encoder: CobsEncoder<'b>,
    digest: Digest<'static, u32>,
    /// Number of bytes that the body may still grow by, the four bytes of the CRC included.
    room: usize,
}

impl Flavor for FrameWriter<'_> {
    type Output = usize;

    fn try_extend(&mut self, data: &[u8]) -> postcard::Result<()> {
        self.room = self
            .room
            .checked_sub(data.len())
            .filter(|room| *room >= CRC_BYTES)
            .ok_or(postcard::Error::SerializeBufferFull)?;
        self.digest.update(data);
        self.encoder.push(data).map_err(|_| postcard::Error::SerializeBufferFull)
    }

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn finalize(mut self) -> postcard::Result<usize> {
        let crc = self.digest.finalize().to_le_bytes();
        self.encoder.push(&crc).map_err(|_| postcard::Error::SerializeBufferFull)?;
        Ok(self.encoder.finalize())
    }
}
