//! Distance of the contenders' codes from a reference in floats.

use artifact::{Artifact, FloatEncoder};
use model::{CELLS, CODE, CODE_SCALE, CODE_ZERO_POINT, STEPS};

use crate::report::failure::Failure;

/// Number of windows that are compared: the reference is slow.
const COMPARED: usize = 32;

/// Encodes the first windows in floats.
///
/// # Errors
/// The artifact has no encoder.
pub(crate) fn reference(
    artifact: &Artifact,
    windows: &[[f32; STEPS * CELLS]],
) -> Result<Vec<[f32; CODE]>, Failure> {
    let encoder = FloatEncoder::new(artifact).map_err(Failure::input)?;
    let windows = windows.iter().take(COMPARED);
    Ok(windows.map(|window| encoder.encode(window)).collect())
}

/// Returns the rms difference of int8 codes from the reference, in quantisation levels. A reference
/// outside the range of int8 counts as the end of the range.
pub(crate) fn rms_levels(codes: &[i32], reference: &[[f32; CODE]]) -> f64 {
    let mut sum = 0.0;
    for (codes, reference) in codes.chunks_exact(CODE).zip(reference) {
        for (dimension, (&code, z)) in codes.iter().zip(reference).enumerate() {
            let exact = z / CODE_SCALE[dimension] + f32::from(CODE_ZERO_POINT[dimension]);
            let exact = f64::from(exact.clamp(i8::MIN.into(), i8::MAX.into()));
            sum += (f64::from(code) - exact).powi(2);
        }
    }
    let values = u32::try_from(reference.as_flattened().len()).unwrap_or(u32::MAX);
    (sum / f64::from(values)).sqrt()
}

/// Returns the largest difference of float codes from the reference, relative to its largest value, or NaN when
/// a code is NaN.
pub(crate) fn relative(codes: &[f32], reference: &[[f32; CODE]]) -> f64 {
    let reference = reference.as_flattened();
    let largest = reference
        .iter()
        .fold(0.0_f32, |largest, z| largest.max(z.abs()));
    let differences = codes
        .iter()
        .zip(reference)
        .map(|(code, z)| (code - z).abs());
    // `f32::max` would drop a NaN.
    let most = differences.fold(0.0_f32, |most, difference| {
        let stays = most.is_nan() || difference <= most;
        if stays { most } else { difference }
    });
    f64::from(most) / f64::from(largest)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::report::limits::{self, Bound};

    /// A code in floats whose int8 values are 3 above their zero points.
    fn exact() -> [f32; CODE] {
        CODE_SCALE.map(|scale| 3.0 * scale)
    }

    fn bound(figure: &str) -> Bound {
        let limits = limits::read("host").expect("limits.toml");
        limits[figure].bound
    }

    #[test]
    fn a_code_with_other_values_is_beyond_the_limit() {
        let codes = |above: i32| CODE_ZERO_POINT.map(|zero| i32::from(zero) + above);
        assert!(rms_levels(&codes(3), &[exact()]) < 0.01);
        let distance = rms_levels(&codes(100), &[exact()]);
        assert!(!bound("int8_rms_steps").contains(&json!(distance)));
    }

    #[test]
    fn one_float_that_is_off_or_no_number_is_beyond_the_limit() {
        let bound = bound("torch_relative");
        assert!(bound.contains(&json!(relative(&exact(), &[exact()]))));
        for wrong in [f32::NAN, 1e6] {
            let mut codes = exact();
            codes[5] = wrong;
            let distance = relative(&codes, &[exact()]);
            assert!(!bound.contains(&json!(distance)), "{distance}");
        }
    }
}
