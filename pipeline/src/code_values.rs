//! The numbers of a code.

use int8_nn::saturate_i8;
use model::{CODE, CodeFormat};

/// The largest exponent: it leaves 8 of 16 bits.
const LARGEST_EXPONENT: u8 = 8;

/// The numbers of a code, in the format of the model, [`model::CODE_FORMAT`].
///
/// `z = (step - model::CODE_ZERO_POINT) * model::CODE_SCALE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodeValues {
    /// The steps.
    Int8([i8; CODE]),
    /// `step = value * 2^exponent`, rounded half up.
    Int8Exponent {
        /// The smallest of 0..=8 with which no value is clipped; 8 where there is none.
        exponent: u8,
        /// The values.
        values: [i8; CODE],
    },
    /// The steps.
    Int16([i16; CODE]),
}

impl CodeValues {
    /// Bytes that hold a code of any format.
    pub const MOST_BYTES: usize = CodeFormat::Int16.bytes();

    /// Brings 128 steps into a format; gives the values and how many of them were clipped
    /// (0..=128). No branch depends on a step.
    #[inline]
    pub(crate) fn of(format: CodeFormat, step: impl Fn(usize) -> i32) -> (Self, u8) {
        let mut clipped = 0;
        let values = match format {
            CodeFormat::Int8 => Self::Int8(core::array::from_fn(|j| {
                let step = step(j);
                let value = saturate_i8(step);
                clipped += u8::from(i32::from(value) != step);
                value
            })),
            CodeFormat::Int8Exponent => {
                let steps = core::array::from_fn(step);
                let exponent = exponent(&steps);
                let values = steps.map(|step| {
                    let rounded = round(step, exponent);
                    let value = saturate_i8(rounded);
                    clipped += u8::from(i32::from(value) != rounded);
                    value
                });
                Self::Int8Exponent { exponent, values }
            }
            CodeFormat::Int16 => Self::Int16(core::array::from_fn(|j| {
                let step = step(j);
                let value = saturate_i16(step);
                clipped += u8::from(i32::from(value) != step);
                value
            })),
        };
        (values, clipped)
    }

    /// The power of two that all values share; 0 in the formats without one.
    pub const fn exponent(&self) -> u8 {
        match self {
            Self::Int8(_) | Self::Int16(_) => 0,
            Self::Int8Exponent { exponent, .. } => *exponent,
        }
    }

    /// The values, whatever their width.
    pub fn integers(&self) -> [i16; CODE] {
        match self {
            Self::Int8(values) | Self::Int8Exponent { values, .. } => values.map(i16::from),
            Self::Int16(values) => *values,
        }
    }

    /// The steps: values times 2^exponent.
    pub fn steps(&self) -> [i32; CODE] {
        let exponent = self.exponent();
        self.integers().map(|value| i32::from(value) << exponent)
    }

    /// The code as [`CodeFormat::bytes`] bytes: exponent, if there is one, and values, the least
    /// significant byte first.
    pub fn bytes<'b>(&self, buffer: &'b mut [u8; Self::MOST_BYTES]) -> &'b [u8] {
        let length = match self {
            Self::Int8(values) => write(buffer, values.map(i8::to_le_bytes).as_flattened()),
            Self::Int8Exponent { exponent, values } => {
                buffer[0] = *exponent;
                let values = values.map(i8::to_le_bytes);
                1 + write(&mut buffer[1..], values.as_flattened())
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

/// The smallest exponent with which every step, rounded, is within 8 bits; the largest where none
/// is. A step that fits with one exponent fits with every larger one, so those that do not are
/// counted.
#[inline]
fn exponent(steps: &[i32; CODE]) -> u8 {
    let fold = |choose: fn(i32, i32) -> i32| steps.iter().fold(0, |end, &step| choose(end, step));
    let (least, greatest) = (fold(i32::min), fold(i32::max));
    (0..LARGEST_EXPONENT)
        .map(|exponent| {
            let below = round(least, exponent) < i32::from(i8::MIN);
            let above = round(greatest, exponent) > i32::from(i8::MAX);
            u8::from(below | above)
        })
        .sum()
}

/// `step / 2^exponent`, rounded half up.
#[inline]
fn round(step: i32, exponent: u8) -> i32 {
    step.saturating_add((1 << exponent) >> 1) >> exponent
}

/// Saturates to 16 bits (`SSAT`).
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "clamped to 16 bits")]
fn saturate_i16(value: i32) -> i16 {
    value.clamp(i16::MIN.into(), i16::MAX.into()) as i16
}

#[cfg(test)]
mod tests;
