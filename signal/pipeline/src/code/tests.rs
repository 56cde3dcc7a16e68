//! Compares every code format with model-gen's plain loops, and tests levels at the ends of each
//! format's range.

use std::{vec, vec::Vec};

use artifact::CodeFormat as Described;
use proptest::prelude::*;

use super::*;

/// Every code format, as the enum of this crate and as the enum of `artifact`.
const FORMATS: [(CodeFormat, Described); 3] = [
    (CodeFormat::Int8, Described::Int8),
    (CodeFormat::Int8Exponent, Described::Int8Exponent),
    (CodeFormat::Int16, Described::Int16),
];

fn encoded(format: CodeFormat, levels: &[i32; CODE]) -> (CodeValues, u8) {
    CodeValues::from_levels(format, |j| levels[j])
}

/// Returns the levels of a code: zeros, then the levels in `last`.
fn levels(last: &[i32]) -> [i32; CODE] {
    let mut levels = [0; CODE];
    levels[CODE - last.len()..].copy_from_slice(last);
    levels
}

/// Draws levels of every magnitude, from 0 to far beyond 16 bits.
fn any_levels() -> impl Strategy<Value = [i32; CODE]> {
    (0..=20_u32, prop::collection::vec(any::<i32>(), CODE)).prop_map(|(bits, levels)| {
        let levels: Vec<i32> = levels.into_iter().map(|level| level >> (31 - bits)).collect();
        levels.try_into().expect("a level for each number")
    })
}

/// Returns exponent, last value and number of clipped values of a code whose last level is `level`
/// and whose other levels are 0.
fn with_exponent(level: i32) -> (u8, i16, u8) {
    let (values, clipped) = encoded(CodeFormat::Int8Exponent, &levels(&[level]));
    (values.exponent(), values.integers()[CODE - 1], clipped)
}

proptest! {
    #[test]
    fn every_format_equals_the_reference(levels in any_levels()) {
        for (format, described) in FORMATS {
            let (ours, _) = encoded(format, &levels);
            let theirs = model_gen::integer_code(described, &levels.map(i64::from));
            prop_assert_eq!(ours.exponent(), theirs.exponent);
            prop_assert_eq!(ours.integers().to_vec(), theirs.values.clone());
            prop_assert_eq!(ours.levels().to_vec(), theirs.levels());
        }
    }

    #[test]
    fn an_unclipped_value_is_within_half_of_two_to_the_exponent(levels in any_levels()) {
        for (format, _) in FORMATS {
            let (values, clipped) = encoded(format, &levels);
            // Values are rounded half up: a value times 2^exponent exceeds its level by at most
            // half of 2^exponent, and falls below it by less than half.
            let power = 1_i64 << values.exponent();
            let pairs = values.levels().into_iter().zip(levels);
            let off = pairs.filter(|&(ours, level)| {
                let twice = 2 * (i64::from(ours) - i64::from(level));
                twice <= -power || twice > power
            });
            prop_assert_eq!(off.count(), usize::from(clipped));
        }
    }

    #[test]
    fn a_code_with_an_exponent_is_clipped_only_with_the_largest_exponent(levels in any_levels()) {
        let (values, clipped) = encoded(CodeFormat::Int8Exponent, &levels);
        let exponent = values.exponent();
        prop_assert!(clipped == 0 || exponent == MAX_EXPONENT);
        // With the next smaller exponent some value would have been clipped.
        let finer = exponent.checked_sub(1).map(|finer| {
            let out = |&level: &i32| i8::try_from(round(level, finer)).is_err();
            levels.iter().any(out)
        });
        prop_assert!(finer != Some(false), "{}", exponent);
    }
}

#[test]
fn the_exponent_accounts_for_rounding_and_values_beyond_the_largest_one_are_clipped() {
    for (level, expected) in [
        (0, (0, 0, 0)),
        (127, (0, 127, 0)),
        (128, (1, 64, 0)),
        (254, (1, 127, 0)),
        // 255 / 2 = 127.5 rounds up to 128, which does not fit 8 bits.
        (255, (2, 64, 0)),
        (-128, (0, -128, 0)),
        (-129, (1, -64, 0)),
        // -257 / 2 = -128.5 rounds up to -128, which fits 8 bits.
        (-257, (1, -128, 0)),
        (-258, (2, -64, 0)),
        (32_639, (8, 127, 0)),
        (32_640, (8, 127, 1)),
        (-32_896, (8, -128, 0)),
        (-32_897, (8, -128, 1)),
        (i32::MAX, (8, 127, 1)),
        (i32::MIN, (8, -128, 1)),
    ] {
        assert_eq!(with_exponent(level), expected, "{level}");
    }
}

#[test]
fn values_beyond_sixteen_bits_are_clipped_and_counted() {
    let last = [-32_769, -32_768, 32_767, 32_768, i32::MIN, i32::MAX];
    let (values, clipped) = encoded(CodeFormat::Int16, &levels(&last));
    let expected = [-32_768, -32_768, 32_767, 32_767, -32_768, 32_767];
    assert_eq!(values.integers()[CODE - 6..], expected);
    assert_eq!(clipped, 4);
    for (format, _) in FORMATS {
        assert_eq!(usize::from(encoded(format, &[i32::MIN; CODE]).1), CODE.min(255), "all of them");
    }
}

#[test]
fn a_code_has_the_bytes_of_its_format() {
    let mut buffer = [0; CodeValues::MAX_BYTES];
    let mut bytes = |format| {
        let (values, _) = encoded(format, &levels(&[-2, 300]));
        let bytes = values.to_bytes(&mut buffer).to_vec();
        assert_eq!(bytes.len(), format.bytes());
        (bytes[0], bytes[bytes.len() - 4..].to_vec())
    };
    assert_eq!(bytes(CodeFormat::Int8), (0, vec![0, 0, 0xfe, 127]));
    assert_eq!(bytes(CodeFormat::Int8Exponent), (2, vec![0, 0, 0, 75]));
    assert_eq!(bytes(CodeFormat::Int16), (0, vec![0xfe, 0xff, 0x2c, 1]));
}
