//! From message to frame.

use core::fmt;

use cobs::CobsEncoder;
use crc::{CRC_32_ISCSI, Crc, Digest};
use postcard::ser_flavors::Flavor;

use crate::{Header, Message, VERSION};

/// CRC-32C (Castagnoli); crc's name for it is CRC-32/ISCSI.
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// The CRC as it stands before the header: the direction is in it.
pub(crate) fn digest<'m, M: Message<'m>>() -> Digest<'static, u32> {
    let mut digest = CRC.digest();
    digest.update(&[M::DIRECTION]);
    digest
}

/// Bytes of the CRC.
pub(crate) const CRC_BYTES: usize = 4;

/// Longest body (header, message and CRC before COBS), bytes. The largest message is an `Audit`,
/// a window's int8 planes with its code, 1733 (test `samples_windows_and_self_tests_fit_a_frame`).
pub const MAX_BODY: usize = 2048;

/// Longest frame with both zeros, bytes.
pub const MAX_FRAME: usize = cobs::max_encoding_length(MAX_BODY) + 2;

/// The message does not fit: the buffer is shorter than the frame, or the body would exceed
/// [`MAX_BODY`]. Give [`encode`] a buffer of [`MAX_FRAME`] bytes and keep texts within their
/// limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncodeError {
    /// Length of the buffer, bytes.
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

/// Write one frame into `out`, both zeros included, and return the part written.
///
/// One pass, no scratch buffer: postcard's bytes go through the CRC and into COBS as they come.
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
        let sink = FrameSink {
            encoder: CobsEncoder::new(inner),
            digest: digest::<M>(),
            room: MAX_BODY,
        };
        postcard::serialize_with_flavor(&(header, message), sink).map_err(|_| error)?
    };
    out[0] = 0;
    out[1 + written] = 0;
    Ok(&out[..written + 2])
}

/// Numbers frames and writes them: one per direction and device.
#[derive(Clone, Debug, Default)]
pub struct Encoder {
    next_seq: u32,
}

impl Encoder {
    /// An encoder whose first frame has `seq`.
    pub const fn starting_at(seq: u32) -> Encoder {
        Encoder { next_seq: seq }
    }

    /// The `seq` that the next frame will have.
    pub const fn next_seq(&self) -> u32 {
        self.next_seq
    }

    /// Number a frame and write it into `out`; a frame that is then dropped stays numbered.
    ///
    /// # Errors
    ///
    /// As [`encode`]; the number is used up all the same, so that the loss shows at the receiver.
    pub fn encode<'m, 'b, M: Message<'m>>(
        &mut self,
        device_time_us: u64,
        message: &M,
        out: &'b mut [u8],
    ) -> Result<&'b [u8], EncodeError> {
        encode(&self.number(device_time_us), message, out)
    }

    /// Number a frame that is not even written: it counts as made and lost.
    pub fn skip(&mut self) {
        self.number(0);
    }

    fn number(&mut self, device_time_us: u64) -> Header {
        let header = Header {
            version: VERSION,
            seq: self.next_seq,
            device_time_us,
        };
        self.next_seq = self.next_seq.wrapping_add(1);
        header
    }
}

/// Where postcard's bytes go: through the CRC and into COBS.
struct FrameSink<'b> {
    encoder: CobsEncoder<'b>,
    digest: Digest<'static, u32>,
    /// Bytes that the body may still take, the CRC included.
    room: usize,
}

impl Flavor for FrameSink<'_> {
    type Output = usize;

    fn try_extend(&mut self, data: &[u8]) -> postcard::Result<()> {
        self.room = self
            .room
            .checked_sub(data.len())
            .filter(|room| *room >= CRC_BYTES)
            .ok_or(postcard::Error::SerializeBufferFull)?;
        self.digest.update(data);
        self.encoder
            .push(data)
            .map_err(|_| postcard::Error::SerializeBufferFull)
    }

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn finalize(mut self) -> postcard::Result<usize> {
        let crc = self.digest.finalize().to_le_bytes();
        self.encoder
            .push(&crc)
            .map_err(|_| postcard::Error::SerializeBufferFull)?;
        Ok(self.encoder.finalize())
    }
}
