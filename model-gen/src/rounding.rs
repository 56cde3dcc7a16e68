//! Rounding of f64 to integers, with range checks.

/// Quantises weights with one scale, which is at least `smallest_scale`: `weight = integer * scale`,
/// |integer| <= 127. Returns the integers and the scale.
pub(crate) fn weights_i8(weights: &[f64], smallest_scale: f64) -> (Vec<i8>, f64) {
    let largest = weights.iter().fold(0.0, |m: f64, w| m.max(w.abs()));
    let scale = (largest / 127.0).max(smallest_scale);
    (
        weights.iter().map(|w| saturating_i8(w / scale)).collect(),
        scale,
    )
}

/// Rounds half away from zero and saturates to -128..=127.
#[expect(clippy::cast_possible_truncation, reason = "clamped to -128..=127")]
pub(crate) fn saturating_i8(value: f64) -> i8 {
    value.round().clamp(-128.0, 127.0) as i8
}

/// Rounds half away from zero; returns `None` if the result does not fit 32 bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "checked against the range of i32"
)]
pub(crate) fn to_i32(value: f64) -> Option<i32> {
    let rounded = value.round();
    (rounded.abs() < f64::from(i32::MAX)).then_some(rounded as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_weight_becomes_127() {
        let (weights, scale) = weights_i8(&[0.5, -1.0, 0.25], 1e-6);
        assert_eq!((weights, scale), (vec![64, -127, 32], 1.0 / 127.0));
    }

    #[test]
    fn weights_far_below_the_smallest_scale_become_zero() {
        assert_eq!(weights_i8(&[0.0, 1e-9], 1e-3), (vec![0, 0], 1e-3));
    }

    #[test]
    fn a_number_beyond_32_bits_is_refused() {
        assert_eq!(to_i32(1e10), None);
        assert_eq!(to_i32(f64::NAN), None);
        assert_eq!(to_i32(-2.5), Some(-3));
    }
}
