//! The numbers of a code, in one of three formats.

use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// Values in a code.
pub const CODE_LEN: usize = 128;

/// Largest exponent of a code: it leaves 8 of 16 bits.
pub const MAX_EXPONENT: u8 = 8;

/// The numbers of a code. In every format `z = (step - code_zero_point) * code_scale`, with the
/// numbers of [`Capabilities`](crate::Capabilities), and `step` as said here.
///
/// On the wire one byte with the format's number, then as many bytes as the format has, always:
/// none is a varint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CodeValues {
    /// 0: 128 bytes, each a step.
    Int8(#[serde(with = "crate::array")] [i8; CODE_LEN]),
    /// 1: a power of two for all values, and 128 bytes: `step = value * 2^exponent`.
    Int8Exponent {
        /// 0 to [`MAX_EXPONENT`]; a frame with another one is malformed.
        #[serde(deserialize_with = "exponent")]
        exponent: u8,
        /// The values.
        #[serde(with = "crate::array")]
        values: [i8; CODE_LEN],
    },
    /// 2: 128 steps of 16 bits, least significant byte first.
    Int16(#[serde(with = "crate::array")] [i16; CODE_LEN]),
}

impl CodeValues {
    /// Which of the formats.
    pub const fn format(&self) -> CodeFormat {
        match self {
            CodeValues::Int8(_) => CodeFormat::Int8,
            CodeValues::Int8Exponent { .. } => CodeFormat::Int8Exponent,
            CodeValues::Int16(_) => CodeFormat::Int16,
        }
    }

    /// The steps, -32768 to 32767.
    pub fn steps(&self) -> [i32; CODE_LEN] {
        match self {
            CodeValues::Int8(values) => values.map(i32::from),
            CodeValues::Int8Exponent { exponent, values } => {
                values.map(|value| i32::from(value) << (*exponent).min(MAX_EXPONENT))
            }
            CodeValues::Int16(values) => values.map(i32::from),
        }
    }
}

fn exponent<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u8, D::Error> {
    let exponent = u8::deserialize(deserializer)?;
    if exponent > MAX_EXPONENT {
        return Err(D::Error::custom("an exponent beyond 8"));
    }
    Ok(exponent)
}

/// The format of a device's codes; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum CodeFormat {
    /// 0: [`CodeValues::Int8`].
    Int8,
    /// 1: [`CodeValues::Int8Exponent`].
    Int8Exponent,
    /// 2: [`CodeValues::Int16`].
    Int16,
    /// Any other: a format newer than this host, which cannot read its codes.
    Newer(u8),
}

impl CodeFormat {
    /// The least and the greatest [step](CodeValues::steps) of a code; none of a newer format.
    pub const fn range(self) -> Option<[i32; 2]> {
        match self {
            CodeFormat::Int8 => Some([-128, 127]),
            CodeFormat::Int8Exponent => Some([-128 << MAX_EXPONENT, 127 << MAX_EXPONENT]),
            CodeFormat::Int16 => Some([-32768, 32767]),
            CodeFormat::Newer(_) => None,
        }
    }
}

impl core::fmt::Display for CodeFormat {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            CodeFormat::Int8 => formatter.write_str("int8"),
            CodeFormat::Int8Exponent => formatter.write_str("int8-exponent"),
            CodeFormat::Int16 => formatter.write_str("int16"),
            CodeFormat::Newer(number) => write!(formatter, "number {number}"),
        }
    }
}

impl From<u8> for CodeFormat {
    fn from(byte: u8) -> CodeFormat {
        match byte {
            0 => CodeFormat::Int8,
            1 => CodeFormat::Int8Exponent,
            2 => CodeFormat::Int16,
            newer => CodeFormat::Newer(newer),
        }
    }
}

impl From<CodeFormat> for u8 {
    fn from(format: CodeFormat) -> u8 {
        match format {
            CodeFormat::Int8 => 0,
            CodeFormat::Int8Exponent => 1,
            CodeFormat::Int16 => 2,
            CodeFormat::Newer(newer) => newer,
        }
    }
}
