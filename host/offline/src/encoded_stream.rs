//! What a file of codes holds, and counts of its packed blocks.

use pipeline::PackedCode;

/// What a file of codes holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum EncodedStream {
    /// Codes of the network.
    #[default]
    Codes,
    /// Packed blocks, at this rate, 0 to 15; `None` for the model's.
    Packed(Option<u8>),
}

/// Kind of the codes in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CodeKind {
    /// Codes of the network.
    Codes,
    /// Packed blocks.
    Packed,
}

impl CodeKind {
    /// Returns what codes of this kind are called, and the name of the stream.
    pub(crate) const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Codes => ("codes", "codes"),
            Self::Packed => ("packed blocks", "packed"),
        }
    }

    /// Returns the other kind.
    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Codes => Self::Packed,
            Self::Packed => Self::Codes,
        }
    }
}

/// Counts of the packed blocks of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PackedCounts {
    /// Number of blocks.
    pub blocks: u64,
    /// Number of bits of all blocks, without those of their frames.
    pub bits: u64,
    /// Number of electrode values that were clipped to the range of the inputs.
    pub clipped: u64,
    /// Number of blocks, made after the filters had settled, that the model does not represent
    /// well.
    pub misfits: u64,
    /// Number of blocks, made after the filters had settled, that were too long and have no
    /// content.
    pub blanks: u64,
}

impl PackedCounts {
    pub(crate) fn add(&mut self, code: &PackedCode) {
        self.blocks += 1;
        self.bits += 8 * code.bytes().len() as u64;
        self.clipped += u64::from(code.clipped);
        self.misfits += u64::from(code.is_misfit && !code.settling);
        self.blanks += u64::from(code.is_blank && !code.settling);
    }
}
