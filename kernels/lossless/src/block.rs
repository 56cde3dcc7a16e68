//! A block of samples in compressed form.

/// Largest number of samples in a block.
pub const MAX_SAMPLES: usize = 8;

/// A count of 24 bits in two's complement, as bytes, least significant first.
pub type Count = [u8; 3];

/// Form of a block's bytes, which determines what a decoder must know to decode it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// The counts themselves, sample by sample and channel by channel. Decoding needs no earlier
    /// block, and the next block does not continue from this one.
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
    /// Form of `bytes`, and what is needed to decode them.
    pub kind: Kind,
    /// Number of samples in the block.
    pub samples: usize,
    /// The encoded counts: at most 3 bytes for each.
    pub bytes: &'b [u8],
}

/// Length in bytes of the checksum at the start of a compressed block.
pub(crate) const SUM_BYTES: usize = 2;

/// Returns the sum of the newest counts of all channels, modulo 2^16. A block states this sum after
/// its last sample, so that a decoder can check that it has decoded the same counts.
pub(crate) fn sum(newest: impl Iterator<Item = i32>) -> [u8; SUM_BYTES] {
    let [low, high, ..] = newest.fold(0, i32::wrapping_add).to_le_bytes();
    [low, high]
}

/// Returns a count as an `i32`; its magnitude is at most 2^23.
#[inline]
pub(crate) fn number([low, middle, high]: Count) -> i32 {
    i32::from(u16::from_le_bytes([low, middle])) | i32::from(high.cast_signed()) << 16
}
