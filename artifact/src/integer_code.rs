//! The integers of a code.

use std::fmt;

use crate::{CODE, CodeFormat};

/// The integers of a code, whatever its [`CodeFormat`]: `z = (step - zero point) * scale`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntegerCode {
    /// Power of two that all values share, 0..=8; 0 in the formats without one.
    pub exponent: u8,
    /// The values, -128..=127 in the formats of 8 bits.
    pub values: [i16; CODE],
}

impl IntegerCode {
    /// `value * 2^exponent`.
    pub fn steps(&self) -> [i32; CODE] {
        self.values
            .map(|value| i32::from(value) * 2_i32.pow(self.exponent.into()))
    }
}

impl CodeFormat {
    /// The largest exponent: 8 in the format that has one.
    pub fn largest_exponent(self) -> u8 {
        match self {
            Self::Int8 | Self::Int16 => 0,
            Self::Int8Exponent => 8,
        }
    }

    /// The least and the greatest value.
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
