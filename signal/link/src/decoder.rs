//! Finds frames in a byte stream and verifies them.

use core::fmt;

use crate::frame::{CRC_BYTES, Header, MAX_FRAME, VERSION, digest};
use crate::message::Message;

/// An intact frame, decoded.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame<M> {
    /// Version, number and time of the frame, as the sender wrote them.
    pub header: Header,
    /// A [`ToHost`](crate::ToHost) or a [`ToDevice`](crate::ToDevice); can borrow from the decoder.
    pub message: M,
}

/// Reason why the bytes between two zeros are not a usable frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// More bytes between two zeros than the decoder's buffer holds.
    Oversize,
    /// Invalid COBS: a byte was changed, lost or added.
    Cobs,
    /// The CRC does not match: a byte was changed, lost or added, or the frame belongs to the other
    /// direction (an echo).
    Crc,
    /// An intact frame whose version is this number, not [`VERSION`].
    Version(u8),
    /// An intact frame with a message that is newer than this receiver.
    Unknown {
        /// Header of the frame; its `seq` counts as received.
        header: Header,
        /// Wire number of the message.
        kind: u32,
    },
    /// An intact frame whose content does not match its message number: a fault of the sender.
    Malformed,
}

impl fmt::Display for FrameError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameError::Oversize => write!(formatter, "more than a frame's bytes without a zero"),
            FrameError::Cobs => write!(formatter, "bytes damaged (COBS)"),
            FrameError::Crc => write!(formatter, "bytes damaged, or an echo (CRC)"),
            FrameError::Version(other) => write!(
                formatter,
                "wire version {other}, but this side speaks {VERSION}; bring firmware and bridge \
                 to the same release"
            ),
            FrameError::Unknown { kind, .. } => {
                write!(formatter, "message {kind} is newer than this side and is ignored")
            }
            FrameError::Malformed => write!(formatter, "content does not fit its message"),
        }
    }
}

impl core::error::Error for FrameError {}

/// Counters of a [`Decoder`] since it was created; each wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bytes read, including the zeros between frames.
    pub bytes: u64,
    /// Frames returned as messages.
    pub frames: u32,
    /// Frames refused with [`FrameError::Crc`].
    pub crc: u32,
    /// Frames refused with [`FrameError::Cobs`].
    pub cobs: u32,
    /// Frames refused with [`FrameError::Oversize`].
    pub oversize: u32,
    /// Frames refused with [`FrameError::Version`].
    pub version: u32,
    /// Intact frames with a message that is newer than this receiver ([`FrameError::Unknown`]).
    pub unknown: u32,
    /// Frames refused with [`FrameError::Malformed`].
    pub malformed: u32,
    /// Damaged stretches of the stream: consecutive frames refused with `Crc`, `Cobs` or `Oversize`
    /// count once.
    pub resyncs: u32,
}

/// Finds frames in any byte stream and resynchronises at every zero.
///
/// `N` is the buffer's length in bytes. [`MAX_FRAME`] is long enough for every frame; a device that
/// receives only commands can use less. Nothing is allocated.
///
/// ```
/// use link::{Decoder, Encoder, ToDevice, MAX_FRAME};
/// let mut buffer = [0; MAX_FRAME];
/// let mut input: &[u8] = Encoder::default().encode(0, &ToDevice::Ping, &mut buffer)?;
/// let mut decoder = Decoder::<MAX_FRAME>::new();
/// while let Some(outcome) = decoder.next::<ToDevice>(&mut input) {
///     assert_eq!(outcome.map(|frame| frame.message), Ok(ToDevice::Ping));
/// }
/// # Ok::<(), link::EncodeError>(())
/// ```
#[derive(Debug)]
pub struct Decoder<const N: usize = MAX_FRAME> {
    buffer: [u8; N],
    filled: usize,
    /// True if the buffer holds a frame that was returned; the next byte starts a new frame.
    handed_out: bool,
    overflowed: bool,
    /// True if the last frame was damaged; another damaged frame then belongs to the same stretch.
    damaged: bool,
    counters: Counters,
}

impl<const N: usize> Default for Decoder<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Decoder<N> {
    /// Creates a decoder with an empty buffer and counters at 0; usable in a `static`.
    pub const fn new() -> Self {
        Self {
            buffer: [0; N],
            filled: 0,
            handed_out: false,
            overflowed: false,
            damaged: false,
            counters: Counters {
                bytes: 0,
                frames: 0,
                crc: 0,
                cobs: 0,
                oversize: 0,
                version: 0,
                unknown: 0,
                malformed: 0,
                resyncs: 0,
            },
        }
    }

    /// Returns the counters; [`Decoder::reset`] does not clear them.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Discards an unfinished frame; call this after the port was closed and opened again.
    pub fn reset(&mut self) {
        self.filled = 0;
        self.handed_out = false;
        self.overflowed = false;
    }

    /// Reads bytes from `input` up to the end of a frame. Returns the frame or the reason why it is
    /// refused, and counts either; returns `None` when `input` is used up.
    ///
    /// # Errors
    ///
    /// The inner `Result` is an error if the bytes between two zeros are not a usable frame.
    pub fn next<'d, M: Message<'d>>(
        &'d mut self,
        input: &mut &[u8],
    ) -> Option<Result<Frame<M>, FrameError>> {
        while let Some((&byte, rest)) = input.split_first() {
            *input = rest;
            self.counters.bytes = self.counters.bytes.wrapping_add(1);
            if self.handed_out {
                self.handed_out = false;
                self.filled = 0;
            }
            if byte != 0 {
                match self.buffer.get_mut(self.filled) {
                    Some(place) => {
                        *place = byte;
                        self.filled += 1;
                    }
                    None => self.overflowed = true,
                }
            } else if self.filled > 0 {
                self.handed_out = true;
                return Some(self.finish());
            }
        }
        None
    }

    /// Decodes the bytes between two zeros and updates the counters.
    fn finish<'d, M: Message<'d>>(&'d mut self) -> Result<Frame<M>, FrameError> {
        let outcome = if core::mem::take(&mut self.overflowed) {
            Err(FrameError::Oversize)
        } else {
            decode_in_place(&mut self.buffer[..self.filled])
        };
        let counters = &mut self.counters;
        let counter = match &outcome {
            Ok(_) => &mut counters.frames,
            Err(FrameError::Oversize) => &mut counters.oversize,
            Err(FrameError::Cobs) => &mut counters.cobs,
            Err(FrameError::Crc) => &mut counters.crc,
            Err(FrameError::Version(_)) => &mut counters.version,
            Err(FrameError::Unknown { .. }) => &mut counters.unknown,
            Err(FrameError::Malformed) => &mut counters.malformed,
        };
        *counter = counter.wrapping_add(1);
        let damaged =
            matches!(outcome, Err(FrameError::Oversize | FrameError::Cobs | FrameError::Crc));
        if damaged && !self.damaged {
            counters.resyncs = counters.resyncs.wrapping_add(1);
        }
        self.damaged = damaged;
        outcome
    }
}

/// Reverses COBS in place, checks the CRC, and reads header and message.
fn decode_in_place<'d, M: Message<'d>>(bytes: &'d mut [u8]) -> Result<Frame<M>, FrameError> {
    let length = cobs::decode_in_place(bytes).map_err(|_| FrameError::Cobs)?;
    let bytes: &'d [u8] = bytes;
    let (body, crc) = bytes[..length].split_last_chunk::<CRC_BYTES>().ok_or(FrameError::Crc)?;
    let mut digest = digest::<M>();
    digest.update(body);
    if digest.finalize() != u32::from_le_bytes(*crc) {
        return Err(FrameError::Crc);
    }
    match body.first() {
        Some(&VERSION) => {}
        Some(&other) => return Err(FrameError::Version(other)),
        None => return Err(FrameError::Malformed),
    }
    let (header, message) =
        postcard::take_from_bytes::<Header>(body).map_err(|_| FrameError::Malformed)?;
    let (kind, _) = postcard::take_from_bytes::<u32>(message).map_err(|_| FrameError::Malformed)?;
    if kind >= M::KINDS {
        return Err(FrameError::Unknown { header, kind });
    }
    let (message, tail) =
        postcard::take_from_bytes::<M>(message).map_err(|_| FrameError::Malformed)?;
    let message = message.with_tail(tail).ok_or(FrameError::Malformed)?;
    Ok(Frame { header, message })
}
