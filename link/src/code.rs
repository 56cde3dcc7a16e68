//! The code of a window, the formats of its values, and audits of codes.

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, de::Error};

use crate::flags::Flags;
use crate::packed;

/// Number of values in a code.
pub const CODE_LEN: usize = 128;

/// Largest exponent of a code: an 8-bit value times 2^8 fills 16 bits.
pub const MAX_EXPONENT: u8 = 8;

/// Output of the encoder for one window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Code {
    /// First 8 bytes of the SHA-256 over the model; only the decoder of that model can read the
    /// values.
    pub model_id: [u8; 8],
    /// Index of the window since `Start`, wraps at 2^32. Increases by one with every code made,
    /// dropped ones included.
    pub window: u32,
    /// Index since `Start` of the ADC sample that yielded the window's first step.
    pub first_sample: u64,
    /// Faults and conditions of the window.
    pub flags: Flags,
    /// Number of electrode values of the window that were clipped to int8; saturates at 65535.
    pub clipped: u16,
    /// Number of values of the code itself that were clipped, 0 to 128.
    pub clipped_values: u8,
    /// ADC channels that reached the converter's rail inside the window. Bit n is channel n; the
    /// first channels carry the electrodes of
    /// [`Capabilities::labels`](crate::Capabilities::labels), in that order.
    pub saturated: u64,
    /// Values, in the format that [`Capabilities::code_format`](crate::Capabilities) announces.
    pub values: CodeValues,
}

/// The values of a code, in one of three formats.
///
/// In every format `z = (level - code_zero_point) * code_scale`, with zero points and scales from
/// [`Capabilities`](crate::Capabilities) and the [levels](Self::levels) defined below. On the wire:
/// one byte with the format's number, then a fixed number of bytes; none of them is a varint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CodeValues {
    /// 0: 128 bytes; each is a level, -128 to 127.
    Int8(#[serde(with = "packed")] [i8; CODE_LEN]),
    /// 1: one exponent shared by all values, then 128 bytes: `level = value * 2^exponent`.
    Int8Exponent {
        /// 0 to [`MAX_EXPONENT`]; a frame with a larger exponent is malformed.
        #[serde(deserialize_with = "exponent")]
        exponent: u8,
        /// Mantissas of the 128 values, -128 to 127.
        #[serde(with = "packed")]
        values: [i8; CODE_LEN],
    },
    /// 2: 128 levels of 16 bits, least significant byte first.
    Int16(#[serde(with = "packed")] [i16; CODE_LEN]),
}

impl CodeValues {
    /// Returns the format of these values; it must equal
    /// [`Capabilities::code_format`](crate::Capabilities).
    pub const fn format(&self) -> CodeFormat {
        match self {
            CodeValues::Int8(_) => CodeFormat::Int8,
            CodeValues::Int8Exponent { .. } => CodeFormat::Int8Exponent,
            CodeValues::Int16(_) => CodeFormat::Int16,
        }
    }

    /// Returns the quantisation levels, -32768 to 32767.
    pub fn levels(&self) -> [i32; CODE_LEN] {
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

/// Format of a device's codes; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum CodeFormat {
    /// 0: [`CodeValues::Int8`].
    Int8,
    /// 1: [`CodeValues::Int8Exponent`].
    Int8Exponent,
    /// 2: [`CodeValues::Int16`].
    Int16,
    /// Any other: a format newer than this host; the host cannot read codes in this format.
    Newer(u8),
}

impl CodeFormat {
    /// Returns the smallest and the largest [level](CodeValues::levels); `None` for a newer format.
    pub const fn range(self) -> Option<[i32; 2]> {
        match self {
            CodeFormat::Int8 => Some([-128, 127]),
            CodeFormat::Int8Exponent => Some([-128 << MAX_EXPONENT, 127 << MAX_EXPONENT]),
            CodeFormat::Int16 => Some([-32768, 32767]),
            CodeFormat::Newer(_) => None,
        }
    }
}

impl fmt::Display for CodeFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
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

/// A window as the encoder read it, with the code it produced; sent every ten seconds if requested.
///
/// A host that has the model recomputes the code and checks that the device computes the same one.
/// The header's time is that of the window's [`Code`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Audit<'a> {
    /// First 8 bytes of the SHA-256 over the model.
    pub model_id: [u8; 8],
    /// Index of the window since `Start`, as in its [`Code`].
    pub window: u32,
    /// Planes of the window, oldest first; every plane is row-major, one int8 byte per cell.
    #[serde(borrow, serialize_with = "packed::serialize_bytes")]
    pub planes: &'a [u8],
    /// Values, in the format that [`Capabilities::code_format`](crate::Capabilities) announces.
    pub values: CodeValues,
}
