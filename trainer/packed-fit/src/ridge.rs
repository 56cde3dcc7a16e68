//! Ridge regression, and the smoother, which estimates the error of a state from the residual of
//! the next block.

use crate::coded::Coded;
use crate::error::FitError;
use crate::integers::Scale;
use artifact::PackedModel;
use nalgebra::{DMatrix, DMatrixView};

/// Penalty of the ridge regressions; [`Ridge::solve`] multiplies it by the number of pairs of
/// blocks.
pub(crate) const PENALTY: f64 = 1.0 / 150.0;

/// Sums from which a linear map is fitted: products of the map's inputs with each other and with
/// its outputs.
#[derive(Clone, Debug)]
pub(crate) struct Ridge {
    /// Sums of the products of inputs with inputs, `[input, input]`.
    inputs: DMatrix<f64>,
    /// Sums of the products of inputs with outputs, `[input, output]`.
    products: DMatrix<f64>,
    pairs: usize,
}

impl Ridge {
    pub(crate) fn new(inputs: usize, outputs: usize) -> Self {
        Self {
            inputs: DMatrix::zeros(inputs, inputs),
            products: DMatrix::zeros(inputs, outputs),
            pairs: 0,
        }
    }

    /// Adds pairs of inputs and outputs; each column is one pair.
    pub(crate) fn add(&mut self, inputs: DMatrixView<'_, f32>, outputs: DMatrixView<'_, f32>) {
        let (inputs, outputs) = (inputs.map(f64::from), outputs.map(f64::from));
        self.inputs.gemm(1.0, &inputs, &inputs.transpose(), 1.0);
        self.products.gemm(1.0, &inputs, &outputs.transpose(), 1.0);
        self.pairs += inputs.ncols();
    }

    /// Returns the result of [`Self::solve`] for the smallest penalty with which the magnitudes of
    /// each output's weights sum to at most `largest_sum`. Tries `penalty` times 1, 2, 4, ...,
    /// because little data can yield large weights.
    ///
    /// # Errors
    /// If [`Self::solve`] fails.
    pub(crate) fn solve_within(
        &self,
        mut penalty: f64,
        largest_sum: f64,
    ) -> Result<DMatrix<f64>, FitError> {
        loop {
            let matrix = self.clone().solve(penalty)?;
            let sums = matrix.row_iter().map(|weights| weights.abs().sum());
            if sums.fold(0.0, f64::max) <= largest_sum {
                return Ok(matrix);
            }
            penalty *= 2.0;
        }
    }

    /// Returns the matrix `[output, input]` that minimises the mean of the squared errors plus
    /// `penalty` times the sum of the squared weights.
    ///
    /// # Errors
    /// If there are no pairs, an input is not finite, or the inputs are linearly dependent and the
    /// penalty is 0.
    pub(crate) fn solve(mut self, penalty: f64) -> Result<DMatrix<f64>, FitError> {
        for index in 0..self.inputs.nrows() {
            self.inputs[(index, index)] += penalty * self.pairs as f64;
        }
        let factors = self.inputs.cholesky().ok_or(FitError::Silent)?;
        Ok(factors.solve(&self.products).transpose())
    }
}

/// Fits the smoother of one rate, `[coefficient][residual of the next block]`, to coded blocks.
pub(crate) fn fit_smoother(
    model: &PackedModel,
    coded: &[Coded],
    coefficients: &[Vec<i16>],
    scale: Scale,
) -> Result<Vec<f64>, FitError> {
    let mut ridge = Ridge::new(scale.count, scale.count);
    for (coded, coefficients) in coded.iter().zip(coefficients) {
        let missing = scale.columns(coefficients) - scale.columns(&coded.states);
        let next = next_residuals(model, &coded.states, scale);
        ridge.add(next.columns(0, next.ncols()), missing.columns(0, next.ncols()));
    }
    let matrix = ridge.solve(PENALTY)?;
    Ok(matrix.transpose().as_slice().to_vec())
}

/// Returns, for each block except the last, the dequantised residual (state minus prediction) of
/// the next block.
pub(crate) fn next_residuals(model: &PackedModel, states: &[i16], scale: Scale) -> DMatrix<f32> {
    let blocks = states.chunks_exact(scale.count);
    let predictions: Vec<i16> = blocks.flat_map(|state| model.predict(state)).collect();
    let (states, predictions) = (scale.columns(states), scale.columns(&predictions));
    let last = states.ncols().saturating_sub(1);
    states.columns(1, last) - predictions.columns(0, last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_map_is_found_and_a_penalty_shrinks_it() {
        // The map y = 2 a - b at four points, each a column.
        let inputs = DMatrix::from_row_slice(2, 4, &[1.0, 0.0, 2.0, -1.0, 0.0, 1.0, 1.0, 3.0]);
        let outputs = DMatrix::from_row_slice(1, 4, &[2.0, -1.0, 3.0, -5.0]);
        let mut ridge = Ridge::new(2, 1);
        ridge.add(inputs.columns(0, 4), outputs.columns(0, 4));
        let solve = |penalty| ridge.clone().solve(penalty).unwrap();
        let exact = solve(0.0);
        assert!((exact[(0, 0)] - 2.0).abs() < 1e-9 && (exact[(0, 1)] + 1.0).abs() < 1e-9);
        assert!(solve(2.5).norm() < exact.norm());
        assert!(Ridge::new(2, 1).solve(0.0).is_err());
        // The penalty grows until the magnitudes of the output's weights sum to at most the limit.
        for (limit, least) in [(3.0, 2.5), (1.0, 0.5)] {
            let matrix = ridge.solve_within(0.025, limit).unwrap();
            let sum = matrix.abs().sum();
            assert!((least..=limit).contains(&sum), "{sum}");
        }
    }
}
