//! Bit positions of the chips in a frame.

/// Bit positions of the chips in a frame. The data sheet draws a don't-care bit between two chips of a
/// daisy chain (revision A, figure 41); others report 27 bytes per chip without it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// Chip k starts at bit 216 k.
    Packed = 0,
    /// Chip k starts at bit 217 k, because of a don't-care bit between chips.
    Spaced = 1,
}

impl Alignment {
    /// Returns the offset of chip k from byte 27 k, in bits: 0 to 7 for k < 8.
    #[inline]
    pub(crate) const fn shift(self, chip: u32) -> u32 {
        // A product instead of a branch; the mask bounds the shift for the compiler.
        (self as u32 * chip) & 7
    }

    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Packed => Self::Spaced,
            Self::Spaced => Self::Packed,
        }
    }
}
