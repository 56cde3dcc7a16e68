//! The ADC's samples as they came.

use serde::{Deserialize, Serialize};

use crate::Flags;

/// Samples that a device puts into a [`Raw`] at most: 64 channels take 1536 bytes of the body.
pub const RAW_SAMPLES: usize = 8;

/// Bytes of a count in [`Raw::counts`].
pub const COUNT_BYTES: usize = 3;

/// The ADC's samples as they came, all channels, a few at a time; on request. The header's time is
/// the DRDY edge of the last one.
///
/// ```
/// # use link::{Flags, Raw};
/// let raw = Raw {
///     first_sample: 0,
///     channels: 2,
///     flags: Flags::empty(),
///     counts: &[1, 0, 0, 0xff, 0xff, 0xff, 2, 0, 0, 0, 0, 0x80],
/// };
/// assert!(raw.counts().eq([1, -1, 2, -(1 << 23)]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Raw<'a> {
    /// Index since `Start` of the first sample. The next frame's is higher by the samples of this
    /// one; where it is higher still, samples are lost.
    pub first_sample: u64,
    /// Channels of a sample.
    pub channels: u8,
    /// What was wrong with these samples: `ADC_STATUS_BAD`, `LEAD_OFF`, `OVERRUN`.
    pub flags: Flags,
    /// Counts, sample by sample, in each channel by channel; 24 bits in two's complement, least
    /// significant byte first.
    #[serde(borrow, serialize_with = "crate::bytes::serialize")]
    pub counts: &'a [u8],
}

impl Raw<'_> {
    /// The counts, |count| <= 2^23, in their order; a count that is cut is left out.
    pub fn counts(&self) -> impl Iterator<Item = i32> {
        let (counts, _) = self.counts.as_chunks::<COUNT_BYTES>();
        // Into the upper bytes and down again: the sign comes along.
        counts
            .iter()
            .map(|&[low, middle, high]| i32::from_le_bytes([0, low, middle, high]) >> 8)
    }
}
