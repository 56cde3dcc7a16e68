//! The last step of the reference: from steps of the code's scale to the integers of its format.

use artifact::{CODE, CodeFormat, IntegerCode};

use crate::IntegerModel;

/// The code of 128 steps, computed in plain loops: the reference of every format.
///
/// The exponent is the smallest with which every `round(step / 2^exponent)`, half up, is within the
/// format's range, or the largest one where none is; what is still out of the range saturates.
pub fn integer_code(format: CodeFormat, steps: &[i64; CODE]) -> IntegerCode {
    let [least, greatest] = format.range().map(i64::from);
    let rounded = |step: i64, exponent: u8| {
        let power = 2_i64.pow(exponent.into());
        (step + power / 2).div_euclid(power)
    };
    let largest = format.largest_exponent();
    let fits = |exponent: &u8| {
        steps
            .iter()
            .all(|&step| (least..=greatest).contains(&rounded(step, *exponent)))
    };
    let exponent = (0..=largest).find(fits).unwrap_or(largest);
    IntegerCode {
        exponent,
        #[expect(
            clippy::cast_possible_truncation,
            reason = "clamped to 16 bits or less"
        )]
        values: steps.map(|step| rounded(step, exponent).clamp(least, greatest) as i16),
    }
}

impl IntegerModel {
    /// `z = (step - zero point) * scale`.
    pub fn dequantise(&self, code: &IntegerCode) -> [f32; CODE] {
        let steps = code.steps();
        std::array::from_fn(|j| {
            #[expect(clippy::cast_precision_loss, reason = "17 bits")]
            let steps = (steps[j] - i32::from(self.code_zero_point[j])) as f32;
            steps * self.code_scale[j]
        })
    }
}
