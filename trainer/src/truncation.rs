//! Reconstruction error of PCA codes from which only the first numbers are decoded.

use crate::dataset::Window;
use crate::evaluate::CodedBlock;
use artifact::{Artifact, ArtifactError};
use packed_fit::in_parallel;

/// Error of PCA codes from which only the first `numbers` numbers are decoded, over all windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TruncationError {
    pub(crate) numbers: usize,
    /// Mean squared error with float codes, in units of `input.sd_uv` squared.
    pub(crate) mse_float: f64,
    /// Mean squared error with integer codes, in units of `input.sd_uv` squared.
    pub(crate) mse_int8: f64,
}

/// Sums of squared errors of codes decoded from the first number only, the first two, up to all.
#[derive(Clone, Debug)]
pub(crate) struct TruncationSums {
    /// Columns of the decoder's matrix, one for each number of a code: the window that is decoded
    /// from a code whose number at this index is 1 and whose other numbers are 0.
    components: Vec<Vec<f32>>,
    /// Sums of squared errors with float and with integer codes: for the first number only, the
    /// first two, up to all.
    squares: Vec<[f64; 2]>,
    /// Number of values in all windows added so far.
    values: usize,
}

impl TruncationSums {
    /// Creates the sums for a model of mode `pca`, before any window is added.
    ///
    /// # Errors
    /// If the model has another mode.
    pub(crate) fn new(model: &Artifact) -> Result<Self, ArtifactError> {
        let dimensions = model.description.dimensions();
        let (window, numbers) = (dimensions.window_electrodes(), dimensions.numbers);
        let decoder = model
            .weights
            .tensor("decoder.shortcut.weight", &[window, numbers])?;
        let component = |number| decoder[number..].iter().step_by(numbers).copied().collect();
        Ok(Self {
            components: (0..numbers).map(component).collect(),
            squares: vec![[0.0; 2]; numbers],
            values: 0,
        })
    }

    /// Adds the errors of a block of windows to the sums.
    pub(crate) fn add(&mut self, block: &CodedBlock) {
        let numbers = self.components.len();
        let codes = block.codes.chunks_exact(numbers);
        let codes = codes.zip(block.received.chunks_exact(numbers));
        let coded: Vec<_> = block.windows.iter().zip(codes).collect();
        // Add up in the order of the windows, so that the number of processors does not matter.
        let errors = in_parallel::map(&coded, |(window, (float, integer))| {
            [self.errors(window, float), self.errors(window, integer)]
        });
        for [float, integer] in errors {
            for (sums, errors) in self.squares.iter_mut().zip(float.into_iter().zip(integer)) {
                sums[0] += errors.0;
                sums[1] += errors.1;
            }
        }
        self.values += block
            .windows
            .iter()
            .map(|window| window.len())
            .sum::<usize>();
    }

    /// Returns the squared errors of a window that is decoded from the first number of its code
    /// only, from the first two, up to all.
    fn errors(&self, window: &Window, code: &[f32]) -> Vec<f64> {
        let mut rest = window.to_vec();
        let numbers = self.components.iter().zip(code);
        numbers
            .map(|(component, number)| {
                let mut sum = 0.0;
                for (rest, component) in rest.iter_mut().zip(component) {
                    *rest -= number * component;
                    sum += f64::from(*rest).powi(2);
                }
                sum
            })
            .collect()
    }

    /// Returns the errors with the first number only, the first two, up to all.
    pub(crate) fn errors_by_numbers(&self) -> Vec<TruncationError> {
        let values = self.values as f64;
        let sums = (1..).zip(&self.squares);
        sums.map(|(numbers, [float, integer])| TruncationError {
            numbers,
            mse_float: float / values,
            mse_int8: integer / values,
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::{evaluate, evaluate_blocks};
    use crate::testing;

    #[test]
    fn the_error_is_that_of_the_numbers_left_out_plus_that_of_rounding() {
        let mut dataset = testing::dataset(9, 256);
        dataset.scale(5.0);
        let parameters = testing::pca();
        let model = testing::model(&parameters, &dataset);
        let mut sums = TruncationSums::new(&model).unwrap();
        let (mut windows, mut energy) = (0, 0.0);
        // The expected errors follow from the codes alone, because the directions d are
        // orthonormal: |x - sum of zq d|^2 = |x|^2 + sum of (zq^2 - 2 z zq), where z is a float
        // number and zq an integer one.
        let numbers = testing::directions().len();
        let mut gains = vec![[0.0; 2]; numbers];
        evaluate_blocks(&model, &dataset, |block| {
            sums.add(block);
            windows += block.windows.len();
            energy += block
                .windows
                .iter()
                .flat_map(|window| window.iter())
                .map(|value| f64::from(*value).powi(2))
                .sum::<f64>();
            for (at, (z, zq)) in block.codes.iter().zip(block.received).enumerate() {
                let [z, zq] = [z, zq].map(|number| f64::from(*number));
                gains[at % numbers][0] -= z * z;
                gains[at % numbers][1] += zq * zq - 2.0 * z * zq;
            }
        })
        .unwrap();
        let values = (windows * testing::description().dimensions().window_electrodes()) as f64;
        let mut expected = [energy; 2];
        let errors = sums.errors_by_numbers();
        assert_eq!(errors.len(), numbers);
        for (error, gain) in errors.iter().zip(gains) {
            expected = [expected[0] + gain[0], expected[1] + gain[1]];
            for (mse, sum) in [error.mse_float, error.mse_int8].iter().zip(expected) {
                // The bound allows for the decoder's f32; the measured difference is 5e-7.
                let difference = (mse * values / sum - 1.0).abs();
                assert!(difference < 1e-5, "{error:?}, {difference}");
            }
        }
        let whole = evaluate(&model, &dataset).unwrap();
        let last = errors[numbers - 1];
        assert_eq!(last.numbers, numbers);
        assert!((last.mse_float / whole.float.mse - 1.0).abs() < 1e-5);
        assert!((last.mse_int8 / whole.integer.mse - 1.0).abs() < 1e-5);
        assert!(last.mse_float < 0.99 * errors[numbers / 2].mse_float);
    }
}
