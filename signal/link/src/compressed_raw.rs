//! ADC samples, compressed without loss.

use serde::{Deserialize, Serialize};

use crate::byte_slice;
use crate::flags::Flags;

/// The samples of a [`Raw`](crate::Raw), compressed without loss; sent if requested.
///
/// The header's time is that of the last sample's DRDY edge. `docs/wire-format.md` has the format of
/// the bytes, which never take more than the 3 bytes for each count that a `Raw` takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedRaw<'a> {
    /// Index of the first sample, counted from `Start`. The next frame's index is this index plus
    /// `samples`; a higher one means that samples were lost.
    pub first_sample: u64,
    /// Counts per sample; 64 on a chain of eight ADS1299.
    pub channels: u8,
    /// Faults of the samples in this frame: `ADC_STATUS_BAD`, `LEAD_OFF`, `OVERRUN`.
    pub flags: Flags,
    /// Form of the bytes, and what a host must know in order to decode them.
    pub form: BlockForm,
    /// Number of samples, 1 to [`RAW_SAMPLES`](crate::RAW_SAMPLES).
    pub samples: u8,
    /// The compressed counts.
    #[serde(borrow, serialize_with = "byte_slice::serialize")]
    pub bytes: &'a [u8],
}

/// Form of a block of compressed samples; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum BlockForm {
    /// 0: the counts, not compressed, as in [`Raw`](crate::Raw).
    Verbatim,
    /// 1: compressed; needs no other block.
    Key,
    /// 2: compressed; needs the blocks since the last key block.
    Continuing,
    /// Any other: newer than this host.
    Newer(u8),
}

impl From<u8> for BlockForm {
    fn from(byte: u8) -> BlockForm {
        match byte {
            0 => BlockForm::Verbatim,
            1 => BlockForm::Key,
            2 => BlockForm::Continuing,
            newer => BlockForm::Newer(newer),
        }
    }
}

impl From<BlockForm> for u8 {
    fn from(form: BlockForm) -> u8 {
        match form {
            BlockForm::Verbatim => 0,
            BlockForm::Key => 1,
            BlockForm::Continuing => 2,
            BlockForm::Newer(newer) => newer,
        }
    }
}
