//! The integers of a code.

use crate::CODE;

/// The integers of a code: `z = (step - CODE_ZERO_POINT) * CODE_SCALE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodeFormat {
    /// A step is a number of 8 bits. Its scale reaches twice as far as the calibration did.
    Int8,
    /// A step is a number of 8 bits times 2^exponent, 0..=8, of the whole code. The finest scale is
    /// that of [`CodeFormat::Int16`]; the zero point is 0.
    Int8Exponent,
    /// A step is a number of 16 bits. Its scale reaches 16 times as far as the calibration did;
    /// the zero point is 0.
    Int16,
}

impl CodeFormat {
    /// Bytes of a code.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Int8 => CODE,
            Self::Int8Exponent => 1 + CODE,
            Self::Int16 => 2 * CODE,
        }
    }
}
