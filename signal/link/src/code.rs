//! The code of a window, the formats of its values, and audits of codes.

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, de::Error};

use crate::flags::Flags;
use crate::signal::serialize_bytes;

/// Largest number of values in a code.
pub const MAX_NUMBERS: usize = 256;

/// Largest exponent of a code: an 8-bit value times 2^8 fills 16 bits.
pub const MAX_EXPONENT: u8 = 8;

/// Output of the encoder for one window, as on the wire.
///
/// `pipeline::Code` is the encoder's own type, with an array of the model's length. This type
/// borrows the bytes of a frame, for hosts that talk to devices with any model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Code<'a> {
    /// First 8 bytes of the SHA-256 over the model; only that model's decoder can read the values.
    pub model_id: [u8; 8],
    /// Index of the window since `Start`, wraps at 2^32. Increases by one with every code produced,
    /// including codes that are dropped.
    pub window: u32,
    /// Index of the ADC sample that yielded the window's first step, counted from `Start`.
    pub first_sample: u64,
    /// Faults and conditions of the window.
    pub flags: Flags,
    /// Number of electrode values of the window that were clipped to int8; saturates at 65535.
    pub clipped: u16,
    /// Number of values of the code that were clipped to the range of its format; saturates at 255.
    pub clipped_values: u8,
    /// ADC channels that reached the converter's rail inside the window. Bit n is channel n; the
    /// first channels carry the electrodes of
    /// [`Capabilities::labels`](crate::Capabilities::labels), in that order.
    pub saturated: u64,
    /// Values, in the format that [`Capabilities::code_format`](crate::Capabilities) announces.
    #[serde(borrow)]
    pub values: CodeValues<'a>,
}

/// The values of a code, in one of three formats. They are borrowed bytes, whereas
/// `pipeline::CodeValues` owns an array of the model's length.
///
/// In every format `z = (level - code_zero_point) * code_scale`, with zero points and scales from
/// [`Capabilities`](crate::Capabilities) and the [levels](Self::levels) of the code. On the wire:
/// one byte with the format's number, the exponent if the format has one, then the values up to the
/// end of the message; none of them is a varint. There are as many values as scales in
/// `Capabilities`, at most [`MAX_NUMBERS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CodeValues<'a> {
    encoding: Encoding,
    /// The values as on the wire. Serde skips them, because the frame carries them after the
    /// message's fields.
    #[serde(skip)]
    bytes: &'a [u8],
}

/// Format of the values, with the exponent if the format has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Encoding {
    Int8,
    Int8Exponent {
        #[serde(deserialize_with = "exponent")]
        exponent: u8,
    },
    Int16,
}

impl<'a> CodeValues<'a> {
    /// Creates values in format 0: each byte is a level, -128 to 127 in two's complement.
    pub const fn int8(bytes: &'a [u8]) -> CodeValues<'a> {
        CodeValues { encoding: Encoding::Int8, bytes }
    }

    /// Creates values in format 1: each byte is a value, -128 to 127 in two's complement, and
    /// `level = value * 2^exponent`. A frame with an exponent above [`MAX_EXPONENT`] is malformed.
    pub const fn int8_exponent(exponent: u8, bytes: &'a [u8]) -> CodeValues<'a> {
        CodeValues { encoding: Encoding::Int8Exponent { exponent }, bytes }
    }

    /// Creates values in format 2: each pair of bytes is a 16-bit level, little-endian.
    pub const fn int16(bytes: &'a [u8]) -> CodeValues<'a> {
        CodeValues { encoding: Encoding::Int16, bytes }
    }

    /// Returns the format of these values; it must equal
    /// [`Capabilities::code_format`](crate::Capabilities).
    pub const fn format(&self) -> CodeFormat {
        match self.encoding {
            Encoding::Int8 => CodeFormat::Int8,
            Encoding::Int8Exponent { .. } => CodeFormat::Int8Exponent,
            Encoding::Int16 => CodeFormat::Int16,
        }
    }

    /// Returns the exponent, to base 2, that all values share; 0 in the formats without exponent.
    pub const fn exponent(&self) -> u8 {
        match self.encoding {
            Encoding::Int8 | Encoding::Int16 => 0,
            Encoding::Int8Exponent { exponent } => exponent,
        }
    }

    /// Returns the number of values, not of bytes.
    pub const fn len(&self) -> usize {
        self.bytes.len() / self.width()
    }

    /// Returns true if there are no values. A code without values is malformed; only an audit of a
    /// device without a network has no values.
    pub const fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Returns the quantisation levels, -32768 to 32767.
    pub fn levels(&self) -> impl ExactSizeIterator<Item = i32> + use<'a> {
        let (width, exponent) = (self.width(), self.exponent());
        let shift = if exponent < MAX_EXPONENT { exponent } else { MAX_EXPONENT };
        self.bytes.chunks_exact(width).map(move |bytes| {
            let value = match *bytes {
                [low, high] => i32::from(i16::from_le_bytes([low, high])),
                [byte, ..] => i32::from(byte.cast_signed()),
                [] => 0,
            };
            value << shift
        })
    }

    /// Returns the values as on the wire, without the exponent.
    pub const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Returns values of the same format with the content `bytes`, which follow the fields of a
    /// message; `None` if the bytes end within a value, or hold fewer than `least` or more than
    /// [`MAX_NUMBERS`] values.
    pub(crate) fn with_bytes(self, bytes: &'a [u8], least: usize) -> Option<CodeValues<'a>> {
        let values = CodeValues { bytes, ..self };
        let whole = bytes.len().is_multiple_of(values.width());
        (whole && (least..=MAX_NUMBERS).contains(&values.len())).then_some(values)
    }

    /// Returns the number of bytes of one value.
    const fn width(&self) -> usize {
        match self.encoding {
            Encoding::Int8 | Encoding::Int8Exponent { .. } => 1,
            Encoding::Int16 => 2,
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

byte_enum! {
    /// Format of a device's codes; one byte on the wire.
    ///
    /// `model::CodeFormat` is the device's own type: it has only the formats that a device can
    /// produce, and a host does not link `model`. `artifact::CodeFormat` is the format's name in
    /// the files of a trained model.
    pub enum CodeFormat {
        /// 0: each byte is a level; see [`CodeValues::int8`].
        Int8 = 0,
        /// 1: bytes that share an exponent; see [`CodeValues::int8_exponent`].
        Int8Exponent = 1,
        /// 2: levels of 16 bits; see [`CodeValues::int16`].
        Int16 = 2,
        _ => "Any other: a format newer than this host; the host cannot read codes in this format.",
    }
}

impl CodeFormat {
    /// Returns the smallest and the largest [level](CodeValues::levels) of this format; `None` for
    /// a format newer than this host.
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

/// A window as the encoder read it, with the code it produced; sent every ten seconds if requested.
///
/// A host that has the model recomputes the code and checks that the device has computed the same
/// code. The header holds the time of the window's [`Code`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Audit<'a> {
    /// First 8 bytes of the SHA-256 over the model.
    pub model_id: [u8; 8],
    /// Index of the window since `Start`, as in its [`Code`].
    pub window: u32,
    /// Planes of the window, one for each step, oldest first; every plane is the scalp grid,
    /// row-major, one int8 byte per cell.
    #[serde(borrow, serialize_with = "serialize_bytes")]
    pub planes: &'a [u8],
    /// Values, in the format that [`Capabilities::code_format`](crate::Capabilities) announces;
    /// none from a device without a network.
    pub values: CodeValues<'a>,
}

/// Largest quantiser rate of the packed code, the coarsest; the smallest and finest is 0.
pub const MAX_RATE: u8 = 15;

/// One block of the packed code, for one hop of steps; sent if requested.
///
/// Block `n` covers the steps from `n` times [`hop_steps`](crate::Capabilities::hop_steps) on;
/// blocks do not overlap. The header holds the time of the block's last step. The model is the
/// model that [`Hello`](crate::Hello) names. `docs/packed.md` has the format of the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PackedCode<'a> {
    /// Index of the block since `Start`, wraps at 2^32. Increases by one with every block produced,
    /// including blocks that are dropped.
    pub block: u32,
    /// Quantiser rate of the stream, 0 (finest) to [`MAX_RATE`], which a decoder needs to read the
    /// bytes. A block can be coarser than the stream; its bytes then state its own rate.
    pub rate: u8,
    /// Faults and conditions of the block.
    pub flags: Flags,
    /// Number of electrode values of the block that were clipped to the range of the inputs;
    /// saturates at 65535.
    pub clipped: u16,
    /// ADC channels that reached the converter's rail inside the block; bit n is channel n.
    pub saturated: u64,
    /// Bytes of the block; none if all its magnitudes are 0 and the model's tables make zeros
    /// likely. Serde skips them, because the frame carries them after the message's fields.
    #[serde(skip)]
    pub bytes: &'a [u8],
}
