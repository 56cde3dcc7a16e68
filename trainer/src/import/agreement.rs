//! Comparison with what the exported network computes.

use super::tensors::Reference;
use crate::error::TrainerError;
use artifact::{Artifact, FloatDecoder, FloatEncoder, ScalpGrid};
use std::fmt;

/// Largest accepted difference, relative to the RMS of the reference. Sums of floats in another
/// order differ by about 1e-6, on GPUs with TF32 by up to 1e-3; layers in another order differ by
/// more than 1e-1.
const TOLERANCE: f32 = 2e-3;

/// Largest differences between a model and the exported network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Number of windows compared.
    pub windows: usize,
    /// Largest difference of a number of a code, relative to the RMS of all codes.
    pub codes: f32,
    /// Largest difference of a reconstructed value, relative to the RMS of all reconstructions;
    /// `None` if the file has no reconstructions.
    pub reconstructions: Option<f32>,
}

/// Runs the float network on the windows of the reference.
///
/// # Errors
/// If a difference exceeds the tolerance.
pub(super) fn check_reference(
    model: &Artifact,
    reference: &Reference,
) -> Result<Agreement, TrainerError> {
    let encoder = FloatEncoder::new(model)?;
    let windows = reference.windows.iter();
    let codes: Vec<Vec<f32>> = windows.map(|window| encoder.encode(window)).collect();
    let code_difference = largest_difference("code", &codes, &reference.codes)?;
    let reconstructions = match &reference.reconstructions {
        None => None,
        Some(expected) => {
            let decoder = FloatDecoder::new(model)?;
            let grid = ScalpGrid::new(&model.description);
            let expected = expected.iter().map(|window| grid.gather(window));
            let expected: Vec<Vec<f32>> = expected.collect();
            let found: Vec<Vec<f32>> = codes.iter().map(|code| decoder.decode(code)).collect();
            Some(largest_difference("reconstruction", &found, &expected)?)
        }
    };
    Ok(Agreement {
        windows: codes.len(),
        codes: code_difference,
        reconstructions,
    })
}

/// Returns the largest difference of any value, relative to the RMS of all expected values.
fn largest_difference(
    what: &'static str,
    found: &[Vec<f32>],
    expected: &[Vec<f32>],
) -> Result<f32, TrainerError> {
    let values = || expected.iter().flatten();
    let squares: f32 = values().map(|value| value * value).sum();
    let rms = (squares / values().count().max(1) as f32).sqrt();
    let mut largest = (0.0_f32, 0, 0);
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        for (element, (found, expected)) in found.iter().zip(expected).enumerate() {
            let difference = (found - expected).abs();
            // A NaN is larger than any number.
            if difference.is_nan() || difference > largest.0 {
                largest = (difference, index, element);
            }
        }
    }
    let (difference, index, element) = largest;
    if difference.is_nan() || difference > TOLERANCE * rms {
        return Err(TrainerError::Reference {
            what,
            index,
            element,
            difference,
            rms,
            tolerance: TOLERANCE,
        });
    }
    Ok(if rms > 0.0 { difference / rms } else { 0.0 })
}

impl fmt::Display for Agreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "The codes of {} windows equal the exported network's within {:.0e} of their RMS",
            self.windows, self.codes
        )?;
        match self.reconstructions {
            Some(difference) => write!(f, ", their reconstructions within {difference:.0e}."),
            None => write!(f, "."),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn difference(found: &[f32]) -> Result<f32, TrainerError> {
        let expected = [vec![3.0, 4.0], vec![4.0, -3.0]];
        let found: Vec<Vec<f32>> = found.chunks_exact(2).map(<[f32]>::to_vec).collect();
        largest_difference("code", &found, &expected)
    }

    #[test]
    fn the_largest_difference_is_relative_to_the_rms_of_all_values() {
        let largest = difference(&[3.0, 4.001, 4.0, -3.002]).expect("within the tolerance");
        // sqrt(12.5) is the RMS.
        assert!((largest - 0.002 / 3.535_534).abs() < 1e-6, "{largest}");
    }

    #[test]
    fn a_value_that_is_not_finite_or_differs_too_much_is_refused() {
        for wrong in [f32::NAN, f32::INFINITY, -3.1] {
            let error = difference(&[3.0, 4.0, 4.0, wrong]).expect_err("a wrong value");
            let TrainerError::Reference { index, element, .. } = error else {
                panic!("{error}");
            };
            assert_eq!((index, element), (1, 1));
        }
    }
}
