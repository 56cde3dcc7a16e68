//! A code in integers, as a device sends it.

use std::fmt;

use crate::description::CodeFormat;

/// A code in integers, in any [`CodeFormat`].
///
/// To dequantise it: `z = (level - zero point) * scale`, where `level = value * 2^exponent`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntegerCode {
    /// Common exponent of all values, to base 2, 0..=8; 0 in the formats without exponent.
    pub exponent: u8,
    /// Values of the code in order; -128..=127 in the 8-bit formats.
    pub values: Vec<i16>,
}

impl IntegerCode {
    /// Returns the levels of the code: `value * 2^exponent` for each value.
    pub fn levels(&self) -> Vec<i32> {
        let power = 2_i32.pow(self.exponent.into());
        let levels = self.values.iter().map(|&value| i32::from(value) * power);
        levels.collect()
    }
}

impl CodeFormat {
    /// Returns the largest exponent that a code can have: 8 for `Int8Exponent`, otherwise 0.
    pub fn largest_exponent(self) -> u8 {
        match self {
            Self::Int8 | Self::Int16 => 0,
            Self::Int8Exponent => 8,
        }
    }

    /// Returns the smallest and the largest value that a code of this format can hold.
    pub fn range(self) -> [i16; 2] {
        match self {
            Self::Int8 | Self::Int8Exponent => [i8::MIN.into(), i8::MAX.into()],
            Self::Int16 => [i16::MIN, i16::MAX],
        }
    }
}

impl fmt::Display for CodeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Int8 => "int8",
            Self::Int8Exponent => "int8-exponent",
            Self::Int16 => "int16",
        })
    }
}
