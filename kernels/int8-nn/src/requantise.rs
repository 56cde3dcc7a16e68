//! Requantisation: conversion of 32-bit accumulators to 8 bits.

/// Returns `accumulator * multiplier / 2^32`, rounded half up, as `SMMULR` does.
///
/// The multiplier is Q0.32 in [-0.5, 0.5), so |result| is at most half of |accumulator|. The
/// product is rounded once and not shifted again (CMSIS-NN: "single rounding").
#[inline]
pub fn requantise(accumulator: i32, multiplier: i32) -> i32 {
    high_word(i64::from(accumulator) * i64::from(multiplier))
}

/// Returns the sum of two requantised accumulators, rounded once at the end (two `SMLAL` on a
/// Cortex-M).
///
/// The result wraps only if it would be 2^31: if all four arguments are -2^31, or if three
/// arguments are -2^31 and the fourth is -2^31 + 1. The caller must exclude this by a proof about
/// the accumulators.
#[inline]
pub fn requantise_sum(a: i32, a_multiplier: i32, b: i32, b_multiplier: i32) -> i32 {
    let sum = i64::from(a) * i64::from(a_multiplier);
    high_word(sum.wrapping_add(i64::from(b) * i64::from(b_multiplier)))
}

/// Limits a value to 0..=255 (`USAT`). Negative values become 0, so this is also the ReLU.
#[inline]
#[expect(clippy::cast_sign_loss, reason = "clamped to 0..=255")]
pub fn saturate_u8(value: i32) -> u8 {
    value.clamp(0, 255) as u8
}

/// Limits a value to -128..=127 (`SSAT`).
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "clamped to -128..=127")]
pub fn saturate_i8(value: i32) -> i8 {
    value.clamp(-128, 127) as i8
}

/// Returns `product / 2^32`, rounded half up.
#[inline]
fn high_word(product: i64) -> i32 {
    (product.wrapping_add(1 << 31) >> 32) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUARTER: i32 = 1 << 30;

    #[test]
    fn halves_round_up() {
        assert_eq!(requantise(2, QUARTER), 1);
        assert_eq!(requantise(-2, QUARTER), 0);
        assert_eq!(requantise(-3, QUARTER), -1);
        assert_eq!(requantise(1, QUARTER), 0);
    }

    #[test]
    fn a_sum_is_rounded_once() {
        // The sum 0.25 + 0.25 is a half and rounds up; each quarter alone would round to 0.
        assert_eq!(requantise_sum(1, QUARTER, 1, QUARTER), 1);
    }

    #[test]
    fn values_saturate_at_both_ends_of_the_range() {
        assert_eq!((saturate_u8(-1), saturate_u8(256)), (0, 255));
        assert_eq!((saturate_i8(-129), saturate_i8(128)), (-128, 127));
        assert_eq!((saturate_u8(i32::MIN), saturate_i8(i32::MAX)), (0, 127));
    }
}
