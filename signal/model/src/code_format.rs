//! The integer format of a code.

use crate::constants::CODE;

/// Integer format of a code that a device can make; `link::CodeFormat` is its byte on the wire,
/// which can also be one that this release does not know. A level is dequantised as `z = (level -
/// CODE_ZERO_POINT) * CODE_SCALE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodeFormat {
    /// Levels of 8 bits. The scale covers twice the calibrated range.
    Int8,
    /// Values of 8 bits, and one exponent, 0..=8, for the whole code: a level is `value *
    /// 2^exponent`. The scale is that of [`CodeFormat::Int16`]; the zero point is 0.
    Int8Exponent,
    /// Levels of 16 bits. The scale covers 16 times the calibrated range; the zero point is 0.
    Int16,
}

impl CodeFormat {
    /// Returns the size of a code in bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Int8 => CODE,
            Self::Int8Exponent => 1 + CODE,
            Self::Int16 => 2 * CODE,
        }
    }
}
