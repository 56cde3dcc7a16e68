//! Linear estimates of what quantisation has taken from the coefficients.

use super::coded::Coded;
use super::ridge::Ridge;
use super::transform::PENALTY;
use crate::error::TrainerError;
use artifact::Correction;
use nalgebra::DMatrix;

/// Penalty of the estimate from three states, relative to that of the prediction.
const SMOOTH_PENALTY: f64 = 10.0;

/// Fits the correction of a rate: estimates of coefficient minus state from the block's own state, and
/// from the states of the blocks before and after it.
pub(super) fn fit(
    rate: u8,
    coded: &[Coded],
    coefficients: &[Vec<i16>],
    count: usize,
    unit: f64,
) -> Result<Correction, TrainerError> {
    let mut causal = Ridge::new(count, count);
    let mut smooth = Ridge::new(3 * count, count);
    for (coded, coefficients) in coded.iter().zip(coefficients) {
        let states = columns(&coded.states, count, unit);
        let missing = columns(coefficients, count, unit) - &states;
        causal.add(&states, &missing);
        let inner = states.ncols().saturating_sub(2);
        smooth.add(
            &neighbourhoods(&states),
            &missing.columns(1.min(states.ncols()), inner).into_owned(),
        );
    }
    #[expect(clippy::cast_precision_loss, reason = "a few hundred sequences")]
    let penalty = PENALTY * coded.len() as f64;
    let solve = |ridge: Ridge, penalty| {
        let matrix = ridge.solve(penalty).ok_or(TrainerError::Silent)?;
        #[expect(clippy::cast_possible_truncation, reason = "corrections are f32")]
        let rows = matrix
            .transpose()
            .iter()
            .map(|&value| value as f32)
            .collect();
        Ok::<Vec<f32>, TrainerError>(rows)
    };
    Ok(Correction {
        rate,
        causal: solve(causal, penalty)?,
        smooth: solve(smooth, SMOOTH_PENALTY * penalty)?,
    })
}

/// Returns integers as the columns of a matrix, in units of `input.sd_uv`.
pub(super) fn columns(values: &[i16], count: usize, unit: f64) -> DMatrix<f32> {
    #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
    let scaled = values.iter().map(|&value| (f64::from(value) * unit) as f32);
    DMatrix::from_iterator(count, values.len() / count, scaled)
}

/// Returns the states of each inner block's predecessor, of the block, and of its successor, one above the
/// other.
pub(super) fn neighbourhoods(states: &DMatrix<f32>) -> DMatrix<f32> {
    let (count, inner) = (states.nrows(), states.ncols().saturating_sub(2));
    let mut stacked = DMatrix::zeros(3 * count, inner);
    for part in 0..3 {
        stacked
            .rows_mut(part * count, count)
            .copy_from(&states.columns(part, inner));
    }
    stacked
}
