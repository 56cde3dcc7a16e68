//! Start bit of each chip's part in a frame: with or without a don't-care bit between two chips.

/// Spacing of the chips' parts in a frame. The data sheet draws a don't-care bit between two chips
/// of a daisy chain (revision A, figure 41); other sources report 27 bytes per chip without such a
/// bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// Without a don't-care bit: chip k starts at bit 216 k.
    Packed = 0,
    /// With a don't-care bit between two chips: chip k starts at bit 217 k.
    Spaced = 1,
}

impl Alignment {
    /// Returns the bit offset of the part of chip `chip` from byte `27 * chip` of the frame: 0 to 7 for
    /// `chip` < 8.
    #[inline]
    pub(crate) const fn shift(self, chip: u32) -> u32 {
        // A product is used instead of a branch; the mask shows the compiler that the result is at
        // most 7.
        (self as u32 * chip) & 7
    }

    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Packed => Self::Spaced,
            Self::Spaced => Self::Packed,
        }
    }
}
