//! The code of one window, in every code format.

use int8_nn::saturate_i8;
use model::{CODE, CodeFormat};

/// The code of one window as the encoder returns it (`link::Code` is its form on the wire), with
/// its position in the stream and its status: clipped values, channels at the rail, settling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code {
    /// Index of the window in the run, from 0; wraps.
    pub window: u32,
    /// Index of the last ADC sample at or before the window's first step, counted from the start of
    /// the run; see [`Step::sample`](crate::Step::sample).
    pub first_sample: u64,
    /// Time by which the window's last step follows the ADC sample that completed the window, in
    /// microseconds; see [`Step::offset_us`](crate::Step::offset_us).
    pub offset_us: u16,
    /// Number of electrode values of the window that were clipped to int8.
    pub clipped: u16,
    /// Number of values of the code that were clipped; saturates at 255.
    pub clipped_values: u8,
    /// ADC channels at the rail in any sample since the step before the window; bit n is channel n.
    pub saturated: u64,
    /// True if the filters had not settled at the window's first step: the values are not reliable.
    pub settling: bool,
    /// Values in the model's code format.
    pub values: CodeValues,
}

/// Largest exponent: division by 2^8 reduces a 16-bit level to 8 bits.
const MAX_EXPONENT: u8 = 8;

/// The values of a code in the model's format, [`model::CODE_FORMAT`].
///
/// A level is dequantised as `z = (level - model::CODE_ZERO_POINT) * model::CODE_SCALE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodeValues {
    /// Levels, saturated to 8 bits.
    Int8([i8; CODE]),
    /// Levels divided by 2^exponent, rounded half up and saturated to 8 bits.
    Int8Exponent {
        /// Smallest exponent of 0..=8 with which no value is clipped, or 8 if there is none.
        exponent: u8,
        /// Rounded levels, -128..=127.
        values: [i8; CODE],
    },
    /// Levels, saturated to 16 bits.
    Int16([i16; CODE]),
}

impl CodeValues {
    /// Size of the longest code of any format, in bytes.
    pub const MAX_BYTES: usize = if CODE > 0 {
        CodeFormat::Int16.bytes()
    } else {
        // In a model without a network a code has no values, but in this format the byte of the
        // exponent remains.
        CodeFormat::Int8Exponent.bytes()
    };

    /// Converts levels to a format; returns the values and the number of clipped values, which
    /// saturates at 255. No branch depends on a level.
    #[inline]
    pub(crate) fn from_levels(format: CodeFormat, level: impl Fn(usize) -> i32) -> (Self, u8) {
        let mut clipped = 0_u32;
        let values = match format {
            CodeFormat::Int8 => Self::Int8(core::array::from_fn(|j| {
                let level = level(j);
                let value = saturate_i8(level);
                clipped += u32::from(i32::from(value) != level);
                value
            })),
            CodeFormat::Int8Exponent => {
                let levels = core::array::from_fn(level);
                let exponent = exponent(&levels);
                let values = levels.map(|level| {
                    let rounded = round(level, exponent);
                    let value = saturate_i8(rounded);
                    clipped += u32::from(i32::from(value) != rounded);
                    value
                });
                Self::Int8Exponent { exponent, values }
            }
            CodeFormat::Int16 => Self::Int16(core::array::from_fn(|j| {
                let level = level(j);
                let value = saturate_i16(level);
                clipped += u32::from(i32::from(value) != level);
                value
            })),
        };
        // The condition is constant: only a code of more than 255 values needs the limit.
        let clipped = if CODE > 255 { clipped.min(255) } else { clipped };
        #[expect(clippy::cast_possible_truncation, reason = "at most 255")]
        let clipped = clipped as u8;
        (values, clipped)
    }

    /// Returns the exponent, to base 2, that all values share; 0 in the formats without exponent.
    pub const fn exponent(&self) -> u8 {
        match self {
            Self::Int8(_) | Self::Int16(_) => 0,
            Self::Int8Exponent { exponent, .. } => *exponent,
        }
    }

    /// Returns the stored integers, widened to 16 bits. In the format `Int8Exponent`, the levels
    /// are these integers times 2^[`exponent`](Self::exponent).
    pub fn integers(&self) -> [i16; CODE] {
        match self {
            Self::Int8(values) | Self::Int8Exponent { values, .. } => values.map(i16::from),
            Self::Int16(values) => *values,
        }
    }

    /// Returns the levels: values times 2^exponent.
    pub fn levels(&self) -> [i32; CODE] {
        let exponent = self.exponent();
        self.integers().map(|value| i32::from(value) << exponent)
    }

    /// Serialises the code into [`CodeFormat::bytes`] bytes of the buffer and returns them:
    /// exponent, if the format has one, then values, little-endian.
    pub fn to_bytes<'b>(&self, buffer: &'b mut [u8; Self::MAX_BYTES]) -> &'b [u8] {
        let length = match self {
            Self::Int8Exponent { exponent, values } => {
                buffer[0] = *exponent;
                1 + write(&mut buffer[1..], values.map(i8::to_le_bytes).as_flattened())
            }
            Self::Int8(_) | Self::Int16(_) => return self.value_bytes(buffer),
        };
        &buffer[..length]
    }

    /// Serialises the values without the exponent, little-endian, and returns their bytes.
    pub fn value_bytes<'b>(&self, buffer: &'b mut [u8; Self::MAX_BYTES]) -> &'b [u8] {
        let length = match self {
            Self::Int8(values) | Self::Int8Exponent { values, .. } => {
                write(buffer, values.map(i8::to_le_bytes).as_flattened())
            }
            Self::Int16(values) => write(buffer, values.map(i16::to_le_bytes).as_flattened()),
        };
        &buffer[..length]
    }
}

fn write(buffer: &mut [u8], bytes: &[u8]) -> usize {
    buffer[..bytes.len()].copy_from_slice(bytes);
    bytes.len()
}

/// Returns the smallest exponent with which every rounded level fits 8 bits, or the largest
/// exponent if none suffices. A level that fits with an exponent also fits with all larger
/// exponents, so the number of exponents that are too small is the result.
#[inline]
fn exponent(levels: &[i32; CODE]) -> u8 {
    let fold =
        |choose: fn(i32, i32) -> i32| levels.iter().fold(0, |end, &level| choose(end, level));
    let (least, greatest) = (fold(i32::min), fold(i32::max));
    (0..MAX_EXPONENT)
        .map(|exponent| {
            let below = round(least, exponent) < i32::from(i8::MIN);
            let above = round(greatest, exponent) > i32::from(i8::MAX);
            u8::from(below | above)
        })
        .sum()
}

/// Returns `level / 2^exponent`, rounded half up.
#[inline]
fn round(level: i32, exponent: u8) -> i32 {
    level.saturating_add((1 << exponent) >> 1) >> exponent
}

/// Saturates to -32768..=32767 (one `SSAT` instruction on a Cortex-M).
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "clamped to 16 bits")]
fn saturate_i16(value: i32) -> i16 {
    value.clamp(i16::MIN.into(), i16::MAX.into()) as i16
}

#[cfg(test)]
mod tests;
