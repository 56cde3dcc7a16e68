//! Encodes the levels of a code in the integers of its format.

use artifact::{CodeFormat, IntegerCode};

/// Returns the code of the given levels, which are in units of the code's scale. The plain loops
/// are the reference to which the device's encoder is compared, in every format.
///
/// The exponent is the smallest with which every `round(level / 2^exponent)`, half up, is within
/// the format's range; if no exponent is large enough, it is the largest, and values out of range
/// saturate.
pub fn integer_code(format: CodeFormat, levels: &[i64]) -> IntegerCode {
    let [least, greatest] = format.range().map(i64::from);
    let rounded = |level: i64, exponent: u8| {
        let power = 2_i64.pow(exponent.into());
        (level + power / 2).div_euclid(power)
    };
    let largest = format.largest_exponent();
    let fits = |exponent: &u8| {
        levels
            .iter()
            .all(|&level| (least..=greatest).contains(&rounded(level, *exponent)))
    };
    let exponent = (0..=largest).find(fits).unwrap_or(largest);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "clamped to 16 bits or less"
    )]
    let value = |&level: &i64| rounded(level, exponent).clamp(least, greatest) as i16;
    IntegerCode {
        exponent,
        values: levels.iter().map(value).collect(),
    }
}
