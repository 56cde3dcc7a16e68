//! Fits the smoother: the error of a state, estimated from the next block's residual.

use super::coded::Coded;
use super::ridge::{Ridge, penalty};
use super::scale::Scale;
use crate::error::TrainerError;
use artifact::PackedModel;
use nalgebra::DMatrix;

/// Fits the smoother of one rate to coded blocks, `[coefficient][residual of the next block]`.
pub(super) fn fit(
    model: &PackedModel,
    coded: &[Coded],
    coefficients: &[Vec<i16>],
    scale: Scale,
) -> Result<Vec<f64>, TrainerError> {
    let mut ridge = Ridge::new(scale.count, scale.count);
    for (coded, coefficients) in coded.iter().zip(coefficients) {
        let missing = scale.columns(coefficients) - scale.columns(&coded.states);
        let next = next_residuals(model, &coded.states, scale);
        ridge.add(
            next.columns(0, next.ncols()),
            missing.columns(0, next.ncols()),
        );
    }
    let matrix = ridge.solve(penalty(coded.len()))?;
    Ok(matrix.transpose().as_slice().to_vec())
}

/// Returns, for each block but the last, the dequantised residual of the block after it: state minus
/// prediction.
pub(super) fn next_residuals(model: &PackedModel, states: &[i16], scale: Scale) -> DMatrix<f32> {
    let blocks = states.chunks_exact(scale.count);
    let predictions: Vec<i16> = blocks.flat_map(|state| model.predict(state)).collect();
    let (states, predictions) = (scale.columns(states), scale.columns(&predictions));
    let last = states.ncols().saturating_sub(1);
    states.columns(1, last) - predictions.columns(0, last)
}
