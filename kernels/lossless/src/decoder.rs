//! Decodes blocks of samples.

use core::fmt;

use crate::block::{Block, Count, Kind, MAX_SAMPLES, SUM_BYTES, number, sum};
use crate::channel::{Channel, Order};
use crate::rice;

/// Decodes the blocks of up to `CHANNELS` channels.
#[derive(Clone, Debug)]
pub struct Decoder<const CHANNELS: usize> {
    past: [Channel; CHANNELS],
    /// Number of valid channels in `past`; 0 if only a block that needs no past can follow.
    known: usize,
    counts: [[Count; CHANNELS]; MAX_SAMPLES],
}

impl<const CHANNELS: usize> Decoder<CHANNELS> {
    /// A decoder that has decoded nothing: its first block must not be [`Kind::Continuing`].
    pub const NEW: Self = Self {
        past: [Channel::NEW; CHANNELS],
        known: 0,
        counts: [[[0; 3]; CHANNELS]; MAX_SAMPLES],
    };

    /// Forgets the past: the next block must not be [`Kind::Continuing`]. Call this when a block is
    /// missing.
    pub const fn forget(&mut self) {
        self.known = 0;
    }

    /// Returns true if the decoder can decode a [`Kind::Continuing`] block.
    pub const fn is_synchronised(&self) -> bool {
        self.known > 0
    }

    /// Returns the counts of a block of `channels` channels: the counts of all channels in the
    /// first sample, then in the next sample, and so on.
    ///
    /// # Errors
    /// If the block is damaged, or continues from blocks that this decoder has not decoded. The
    /// decoder then forgets the past.
    pub fn decode(&mut self, channels: usize, block: &Block) -> Result<&[Count], DecodeError> {
        let known = core::mem::take(&mut self.known);
        let is_sized = (1..=MAX_SAMPLES).contains(&block.samples);
        if !is_sized || !(1..=CHANNELS).contains(&channels) {
            return Err(DecodeError::Malformed);
        }
        let counts = self.counts.as_flattened_mut();
        let counts = &mut counts[..block.samples * channels];
        let past = &mut self.past[..channels];
        match block.kind {
            Kind::Verbatim => {
                copy(block.bytes, counts)?;
                return Ok(counts);
            }
            Kind::Key => decompress(past, true, block.bytes, counts)?,
            Kind::Continuing if known != channels => return Err(DecodeError::NoKey),
            Kind::Continuing => decompress(past, false, block.bytes, counts)?,
        }
        self.known = channels;
        Ok(counts)
    }
}

fn copy(bytes: &[u8], counts: &mut [Count]) -> Result<(), DecodeError> {
    let (from, rest) = bytes.as_chunks();
    if from.len() != counts.len() || !rest.is_empty() {
        return Err(DecodeError::Malformed);
    }
    counts.copy_from_slice(from);
    Ok(())
}

/// Decodes a compressed block and updates the past of its channels.
fn decompress(
    past: &mut [Channel],
    is_key: bool,
    bytes: &[u8],
    counts: &mut [Count],
) -> Result<(), DecodeError> {
    let (announced, bits) = bytes.split_first_chunk::<SUM_BYTES>().ok_or(DecodeError::Malformed)?;
    let mut reader = BitReader::new(bits);
    let channels = past.len();
    for (index, channel) in past.iter_mut().enumerate() {
        let mut places = counts[index..].iter_mut().step_by(channels);
        if is_key {
            let first = start_key(channel, &mut reader)?;
            if let Some(place) = places.next() {
                *place = first;
            }
        }
        decode_channel(channel, places, &mut reader)?;
    }
    if !reader.ends() {
        return Err(DecodeError::Malformed);
    }
    if sum(past.iter().map(|channel| channel.past.x)) != *announced {
        return Err(DecodeError::Sum);
    }
    Ok(())
}

/// Reads first count, order and parameter k of a channel in a key block. Returns the first count.
fn start_key(channel: &mut Channel, reader: &mut BitReader) -> Result<Count, DecodeError> {
    let mut take = |bits| reader.take(bits).ok_or(DecodeError::Malformed);
    let [low, middle, high, _] = take(rice::COUNT_BITS)?.to_le_bytes();
    let order = Order::from_bits(take(2)?);
    let k = take(5)?;
    if k > rice::MAX_K {
        return Err(DecodeError::Malformed);
    }
    let first = [low, middle, high];
    channel.start_key(number(first), order, k);
    Ok(first)
}

/// Decodes the codes of one channel and writes its counts to `places`.
fn decode_channel<'c>(
    channel: &mut Channel,
    places: impl Iterator<Item = &'c mut Count>,
    reader: &mut BitReader,
) -> Result<(), DecodeError> {
    let k = channel.k();
    let (mut sum, mut codes) = (0, 0);
    for place in places {
        let zeros = reader.take_zeros(rice::ESCAPE).ok_or(DecodeError::Malformed)?;
        let is_escaped = zeros == rice::ESCAPE;
        let width = if is_escaped { rice::COUNT_BITS } else { k };
        let bits = reader.take(width).ok_or(DecodeError::Malformed)?;
        let count = if is_escaped {
            let [low, middle, high, _] = bits.to_le_bytes();
            number([low, middle, high])
        } else {
            let difference = rice::unfold(zeros << k | bits);
            channel.past.predicted(channel.order).wrapping_add(difference)
        };
        let [low, middle, high, _] = count.to_le_bytes();
        *place = [low, middle, high];
        if number(*place) != count {
            return Err(DecodeError::Malformed);
        }
        let difference = channel.past.append(count)[channel.order as usize];
        sum = rice::fold(difference).wrapping_add(sum);
        codes += 1;
    }
    channel.observe(sum, codes);
    Ok(())
}

/// Reason why a block was refused. After any error, the next block must not be
/// [`Kind::Continuing`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// The block continues from blocks that were not decoded or had another number of channels.
    NoKey,
    /// No encoder writes such a block: its number of samples or channels, its length, the Rice
    /// parameter of a channel or a count is out of range.
    Malformed,
    /// The decoded counts do not have the sum that the block states: the block is damaged, or it
    /// does not continue from the previous block.
    Sum,
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoKey => "the blocks that this one continues from are missing",
            Self::Malformed => {
                "the bytes are too few, too many or out of range for a block of this number of samples \
                 and channels"
            },
            Self::Sum => "the counts do not add up to the block's sum",
        })
    }
}

impl core::error::Error for DecodeError {}

/// Reads bits from bytes, most significant bit first.
#[derive(Debug)]
struct BitReader<'b> {
    bytes: &'b [u8],
    /// Bits that are read from `bytes` but not yet taken, in the most significant places.
    pending: u64,
    /// Number of valid bits in `pending`.
    held: u32,
}

impl<'b> BitReader<'b> {
    const fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, pending: 0, held: 0 }
    }

    /// Takes the next `width` bits, 0 to 32; `None` if there are fewer.
    fn take(&mut self, width: u32) -> Option<u32> {
        self.fill();
        self.held = self.held.checked_sub(width)?;
        // Two shifts, because a single shift by 64, for a `width` of 0, would overflow.
        let bits = (self.pending >> 1) >> (63 - width);
        self.pending <<= width;
        u32::try_from(bits).ok()
    }

    /// Takes the bits up to and including the next 1, and returns the number of zeros before it.
    /// Stops after `most` zeros, without a 1. Returns `None` if the bits end first.
    fn take_zeros(&mut self, most: u32) -> Option<u32> {
        self.fill();
        let zeros = self.pending.leading_zeros();
        let (zeros, width) = if zeros < most { (zeros, zeros + 1) } else { (most, most) };
        self.take(width)?;
        Some(zeros)
    }

    /// Returns true if only padding is left: fewer than 8 bits, all of them 0.
    fn ends(mut self) -> bool {
        self.fill();
        self.held < 8 && self.pending == 0
    }

    /// Reads bytes until `pending` holds at least 57 bits, or no bytes are left.
    fn fill(&mut self) {
        while self.held <= 56 {
            let Some((&byte, rest)) = self.bytes.split_first() else {
                return;
            };
            self.bytes = rest;
            self.pending |= u64::from(byte) << (56 - self.held);
            self.held += 8;
        }
    }
}
