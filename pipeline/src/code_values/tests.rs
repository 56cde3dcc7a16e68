//! The formats against model-gen's plain loops, and at their edges.

use std::{vec, vec::Vec};

use artifact::CodeFormat as Described;
use proptest::prelude::*;

use super::*;

/// Every format, here and in model-gen.
const FORMATS: [(CodeFormat, Described); 3] = [
    (CodeFormat::Int8, Described::Int8),
    (CodeFormat::Int8Exponent, Described::Int8Exponent),
    (CodeFormat::Int16, Described::Int16),
];

fn of(format: CodeFormat, steps: &[i32; CODE]) -> (CodeValues, u8) {
    CodeValues::of(format, |j| steps[j])
}

/// A code of zeros but for these steps at its end.
fn steps(last: &[i32]) -> [i32; CODE] {
    let mut steps = [0; CODE];
    steps[CODE - last.len()..].copy_from_slice(last);
    steps
}

/// Codes of every loudness, from silence to far beyond 16 bits.
fn any_steps() -> impl Strategy<Value = [i32; CODE]> {
    (0..=20_u32, prop::collection::vec(any::<i32>(), CODE)).prop_map(|(bits, steps)| {
        let steps: Vec<i32> = steps.into_iter().map(|step| step >> (31 - bits)).collect();
        steps.try_into().expect("128 steps")
    })
}

/// Exponent, last value and count of clipped values of a code that is zero but for its last step.
fn with_exponent(step: i32) -> (u8, i16, u8) {
    let (values, clipped) = of(CodeFormat::Int8Exponent, &steps(&[step]));
    (values.exponent(), values.integers()[CODE - 1], clipped)
}

proptest! {
    #[test]
    fn every_format_is_that_of_the_reference(steps in any_steps()) {
        for (format, described) in FORMATS {
            let (ours, _) = of(format, &steps);
            let theirs = model_gen::integer_code(described, &steps.map(i64::from));
            prop_assert_eq!(ours.exponent(), theirs.exponent);
            prop_assert_eq!(ours.integers(), theirs.values);
            prop_assert_eq!(ours.steps(), theirs.steps());
        }
    }

    #[test]
    fn what_is_not_clipped_is_within_half_of_two_to_the_exponent(steps in any_steps()) {
        for (format, _) in FORMATS {
            let (values, clipped) = of(format, &steps);
            // Half up: a value may lie above its step by just a half, but not below.
            let power = 1_i64 << values.exponent();
            let pairs = values.steps().into_iter().zip(steps);
            let off = pairs.filter(|&(ours, step)| {
                let twice = 2 * (i64::from(ours) - i64::from(step));
                twice <= -power || twice > power
            });
            prop_assert_eq!(off.count(), usize::from(clipped));
        }
    }

    #[test]
    fn a_code_with_an_exponent_is_clipped_only_when_no_exponent_helps(steps in any_steps()) {
        let (values, clipped) = of(CodeFormat::Int8Exponent, &steps);
        let exponent = values.exponent();
        prop_assert!(clipped == 0 || exponent == LARGEST_EXPONENT);
        // With a smaller one something would have been.
        let finer = exponent.checked_sub(1).map(|finer| {
            let out = |&step: &i32| i8::try_from(round(step, finer)).is_err();
            steps.iter().any(out)
        });
        prop_assert!(finer != Some(false), "{}", exponent);
    }
}

#[test]
fn an_exponent_grows_where_rounding_would_leave_eight_bits() {
    assert_eq!(with_exponent(0), (0, 0, 0));
    assert_eq!(with_exponent(127), (0, 127, 0));
    assert_eq!(with_exponent(128), (1, 64, 0));
    assert_eq!(with_exponent(254), (1, 127, 0));
    // 127.5 rounds up to 128.
    assert_eq!(with_exponent(255), (2, 64, 0));
    assert_eq!(with_exponent(-128), (0, -128, 0));
    assert_eq!(with_exponent(-129), (1, -64, 0));
    // -128.5 rounds up to -128.
    assert_eq!(with_exponent(-257), (1, -128, 0));
    assert_eq!(with_exponent(-258), (2, -64, 0));
}

#[test]
fn beyond_the_largest_exponent_values_are_clipped_and_counted() {
    assert_eq!(with_exponent(32_639), (8, 127, 0));
    assert_eq!(with_exponent(32_640), (8, 127, 1));
    assert_eq!(with_exponent(-32_896), (8, -128, 0));
    assert_eq!(with_exponent(-32_897), (8, -128, 1));
    assert_eq!(with_exponent(i32::MAX), (8, 127, 1));
    assert_eq!(with_exponent(i32::MIN), (8, -128, 1));
}

#[test]
fn sixteen_bits_are_clipped_and_counted_at_their_rails() {
    let last = [-32_769, -32_768, 32_767, 32_768, i32::MIN, i32::MAX];
    let (values, clipped) = of(CodeFormat::Int16, &steps(&last));
    let expected = [-32_768, -32_768, 32_767, 32_767, -32_768, 32_767];
    assert_eq!(values.integers()[CODE - 6..], expected);
    assert_eq!(clipped, 4);
    for (format, _) in FORMATS {
        assert_eq!(of(format, &[i32::MIN; CODE]).1, 128, "all of them");
    }
}

#[test]
fn a_quiet_code_keeps_the_steps_that_a_loud_one_rounds() {
    let quiet = steps(&[-100, 37, 127]);
    assert_eq!(of(CodeFormat::Int8Exponent, &quiet).0.steps(), quiet);
    let loud = steps(&[-100, 37, 20_000]);
    let (values, clipped) = of(CodeFormat::Int8Exponent, &loud);
    assert_eq!((values.exponent(), clipped), (8, 0));
    assert_eq!(values.steps()[CODE - 3..], [0, 0, 19_968]);
}

#[test]
fn a_code_has_the_bytes_of_its_format() {
    let mut buffer = [0; CodeValues::MOST_BYTES];
    let mut bytes = |format| {
        let (values, _) = of(format, &steps(&[-2, 300]));
        let bytes = values.bytes(&mut buffer).to_vec();
        assert_eq!(bytes.len(), format.bytes());
        (bytes[0], bytes[bytes.len() - 4..].to_vec())
    };
    assert_eq!(bytes(CodeFormat::Int8), (0, vec![0, 0, 0xfe, 127]));
    assert_eq!(bytes(CodeFormat::Int8Exponent), (2, vec![0, 0, 0, 75]));
    assert_eq!(bytes(CodeFormat::Int16), (0, vec![0xfe, 0xff, 0x2c, 1]));
}
