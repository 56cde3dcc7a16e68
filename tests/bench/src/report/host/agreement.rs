//! Distance of the contenders' codes from a reference in floats.

use artifact::{Artifact, FloatEncoder};
use model::{CELLS, CODE, CODE_SCALE, CODE_ZERO_POINT, STEPS};

/// Number of windows that are compared; it is small because the reference is slow.
pub(crate) const COMPARED: usize = 32;

/// Encodes the first [`COMPARED`] windows with the float network.
///
/// # Errors
/// The artifact has no encoder.
pub(crate) fn reference(
    artifact: &Artifact,
    windows: &[[f32; STEPS * CELLS]],
) -> anyhow::Result<Vec<Vec<f32>>> {
    let encoder = FloatEncoder::new(artifact)?;
    let windows = windows.iter().take(COMPARED);
    Ok(windows.map(|window| encoder.encode(window)).collect())
}

/// Returns the rms difference of int8 codes from the reference, in quantisation levels. A reference value
/// outside the range of int8 is clamped to the range first.
pub(crate) fn rms_levels(codes: &[i32], reference: &[Vec<f32>]) -> f64 {
    let mut sum = 0.0;
    for (codes, reference) in codes.chunks_exact(CODE).zip(reference) {
        for (dimension, (&code, z)) in codes.iter().zip(reference).enumerate() {
            let exact = z / CODE_SCALE[dimension] + f32::from(CODE_ZERO_POINT[dimension]);
            let exact = f64::from(exact.clamp(i8::MIN.into(), i8::MAX.into()));
            sum += (f64::from(code) - exact).powi(2);
        }
    }
    let values = u32::try_from(reference.concat().len()).unwrap_or(u32::MAX);
    (sum / f64::from(values)).sqrt()
}

/// Returns the largest difference of float codes from the reference, relative to the reference's largest
/// value. No code may be NaN, which would be ignored.
pub(crate) fn relative(codes: &[f32], reference: &[Vec<f32>]) -> f64 {
    let reference = reference.concat();
    let largest = reference.iter().map(|z| z.abs()).fold(0.0, f32::max);
    let differences = codes
        .iter()
        .zip(reference)
        .map(|(code, z)| (code - z).abs());
    f64::from(differences.fold(0.0, f32::max)) / f64::from(largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A code in floats whose int8 values are 3 above their zero points.
    fn exact() -> Vec<f32> {
        CODE_SCALE.map(|scale| 3.0 * scale).to_vec()
    }

    #[test]
    fn int8_codes_are_compared_in_levels() {
        let codes = |above: i32| CODE_ZERO_POINT.map(|zero| i32::from(zero) + above);
        for (above, expected) in [(3, 0.0), (5, 2.0)] {
            let distance = rms_levels(&codes(above), &[exact()]);
            assert!((distance - expected).abs() < 0.01, "{distance}");
        }
    }

    #[test]
    fn one_float_that_is_off_is_the_distance() {
        let mut codes = exact();
        assert!(relative(&codes, &[exact()]) < 1e-9);
        let largest = exact().into_iter().fold(0.0, f32::max);
        codes[5] += 2.0 * largest;
        let distance = relative(&codes, &[exact()]);
        assert!((distance - 2.0).abs() < 1e-6, "{distance}");
    }
}
