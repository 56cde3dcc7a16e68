//! A block of samples in compressed form.

/// Largest number of samples in a block.
pub const MAX_SAMPLES: usize = 8;

/// A 24-bit count in two's complement, as bytes, least significant first.
pub type Count = [u8; 3];

/// How a block is encoded, which determines what a decoder must know to decode the block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// Uncompressed: the counts sample by sample, and within a sample channel by channel. Decoding
    /// needs no earlier block, and the next block does not continue from this one.
    #[default]
    Verbatim,
    /// Compressed, but decoding needs no earlier block: the block contains the first count of each
    /// channel.
    Key,
    /// Compressed; continues from the last sample of the previous block.
    Continuing,
}

/// A block of 1 to [`MAX_SAMPLES`] samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block<'b> {
    /// How `bytes` is encoded.
    pub kind: Kind,
    /// Number of samples in the block.
    pub samples: usize,
    /// The encoded counts: at most 3 bytes for each count.
    pub bytes: &'b [u8],
}

/// Length in bytes of the checksum at the start of a compressed block.
pub(crate) const SUM_BYTES: usize = 2;

/// Returns the sum of the newest counts of all channels, modulo 2^16. A compressed block starts
/// with this sum for its last sample, so that a decoder can check the counts that it has decoded.
pub(crate) fn sum(newest: impl Iterator<Item = i32>) -> [u8; SUM_BYTES] {
    let [low, high, ..] = newest.fold(0, i32::wrapping_add).to_le_bytes();
    [low, high]
}

/// Returns a count as an `i32`; its magnitude is at most 2^23.
#[inline]
pub(crate) fn number([low, middle, high]: Count) -> i32 {
    i32::from(u16::from_le_bytes([low, middle])) | i32::from(high.cast_signed()) << 16
}
