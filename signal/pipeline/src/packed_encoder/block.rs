//! The packed code of one hop.

/// Largest number of bytes of a block. A block that needs more is coded again at a coarser rate.
pub const MAX_PACKED_BYTES: usize = 118;

/// One block of the packed code, with its position in the stream and its status.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each of them can be true with any other"
)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackedCode {
    /// Index of the block in the run, from 0; wraps. Block `n` covers the steps from `n * HOP` on.
    pub block: u32,
    /// Time from the ADC sample that completed the block to its last step, microseconds; see
    /// [`Step::offset_us`](crate::Step::offset_us).
    pub offset_us: u16,
    /// Number of electrode values of the block that were clipped to the range of the inputs.
    pub clipped: u16,
    /// ADC channels that were at the rail in the block, or between the step before it and its first
    /// step; bit n is channel n.
    pub saturated: u64,
    /// True if the filters had not settled at the block's first step.
    pub settling: bool,
    /// Rate that the stream has; a block that was too long has a coarser one, which its bytes state.
    pub rate: u8,
    /// True if the block has no prediction, so that a decoder can start with it.
    pub is_reset: bool,
    /// True if the model does not represent the block well: an electrode without contact, or another cap.
    pub is_misfit: bool,
    /// True if the block was too long at two rates: all its magnitudes are 0, and a decoder shows the prediction.
    pub is_blank: bool,
    pub(super) length: u16,
    pub(super) buffer: [u8; MAX_PACKED_BYTES],
}

impl PackedCode {
    /// Returns the bytes of the block, at most [`MAX_PACKED_BYTES`].
    pub fn bytes(&self) -> &[u8] {
        self.buffer
            .get(..usize::from(self.length))
            .unwrap_or_default()
    }
}
