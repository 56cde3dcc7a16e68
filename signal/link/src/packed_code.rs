//! Blocks of the packed code.

use serde::{Deserialize, Serialize};

use crate::flags::Flags;

/// Largest rate of the packed code; the smallest is 0.
pub const MAX_RATE: u8 = 15;

/// One block of the packed code, for one hop of steps; sent if requested.
///
/// Block `n` covers the steps from `n` times [`hop_steps`](crate::Capabilities::hop_steps) on; blocks do not overlap.
/// The header's time is that of the block's last step. The model is that of [`Hello`](crate::Hello).
/// `docs/packed.md` has the format of the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PackedCode<'a> {
    /// Index of the block since `Start`, wraps at 2^32. Increases by one with every block made,
    /// dropped ones included.
    pub block: u32,
    /// Rate of the stream, 0 to [`MAX_RATE`], which a decoder needs to read the bytes.
    pub rate: u8,
    /// Faults and conditions of the block.
    pub flags: Flags,
    /// Number of electrode values of the block that were clipped to the range of the inputs; saturates
    /// at 65535.
    pub clipped: u16,
    /// ADC channels that reached the converter's rail inside the block; bit n is channel n.
    pub saturated: u64,
    /// The block; empty if it consists of likely zeros only. The message's frame carries the bytes
    /// after the fields.
    #[serde(skip)]
    pub bytes: &'a [u8],
}
