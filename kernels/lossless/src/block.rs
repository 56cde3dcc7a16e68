//! A compressed block of samples.

/// Largest number of samples in a block.
pub const MAX_SAMPLES: usize = 8;

/// A count of 24 bits in two's complement, least significant byte first.
pub type Count = [u8; 3];

/// What a decoder needs in order to decode a block, and how the block holds its counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// The counts themselves, sample by sample and channel by channel. Needs no past; the next
    /// block needs none either.
    #[default]
    Verbatim,
    /// Compressed, without a past: the first count of each channel is contained.
    Key,
    /// Compressed; continues from the last sample of the block before it.
    Continuing,
}

/// A block of 1 to [`MAX_SAMPLES`] samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block<'b> {
    /// Form of the bytes.
    pub kind: Kind,
    /// Number of samples.
    pub samples: usize,
    /// Content: at most 3 bytes for each count of the block.
    pub bytes: &'b [u8],
}

/// Bytes of the sum at the start of a compressed block.
pub(crate) const SUM_BYTES: usize = 2;

/// Adds up the newest counts of all channels, modulo 2^16. At the end of a block encoder and
/// decoder must have the same sum, which is at the start of the block.
pub(crate) fn sum(newest: impl Iterator<Item = i32>) -> [u8; SUM_BYTES] {
    let [low, high, ..] = newest.fold(0, i32::wrapping_add).to_le_bytes();
    [low, high]
}

/// Returns a count as a number, |count| <= 2^23.
#[inline]
pub(crate) fn number([low, middle, high]: Count) -> i32 {
    i32::from(u16::from_le_bytes([low, middle])) | i32::from(high.cast_signed()) << 16
}
