//! Where the chips stand in a frame.

/// Where the chips stand in a frame: the data sheet draws a don't-care bit between two chips of a
/// daisy chain (revision A, figure 41), while others report 27 bytes per chip without it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// Chip k begins at bit 216 k.
    Packed = 0,
    /// Chip k begins at bit 217 k: a don't-care bit between two chips.
    Spaced = 1,
}

impl Alignment {
    /// Bits by which chip k begins later than byte 27 k; k < 8, so 0 to 7.
    #[inline]
    pub(crate) const fn shift(self, chip: u32) -> u32 {
        // A product instead of a branch; the mask says 7 to the compiler as well.
        (self as u32 * chip) & 7
    }

    /// The other one.
    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Packed => Self::Spaced,
            Self::Spaced => Self::Packed,
        }
    }
}
