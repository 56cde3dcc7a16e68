//! The innovation of an electrode: its signal minus the prediction from the other electrodes.

use crate::directions::second_moment;
use crate::track::Track;
use nalgebra::DMatrix;

/// Penalty that is added to the diagonal of the second moment, relative to the mean of the
/// diagonal.
const RIDGE: f64 = 0.01;

/// Number of time steps over which the energy of an innovation is averaged: one second.
pub const SECOND: usize = 128;

/// Returns the matrix that predicts each electrode from the others with the least mean squared
/// error plus a penalty: `w_ei = -P_ei / P_ee` and `w_ee = 0`, where `P` is the inverse of the
/// second moment with 1 % of its mean variance added. `None` if all electrodes are 0.
pub fn prediction<'t>(tracks: impl IntoIterator<Item = &'t Track>) -> Option<DMatrix<f64>> {
    let mut moment = second_moment(&tracks.into_iter().map(columns).collect::<Vec<_>>());
    let penalty = RIDGE * moment.diagonal().mean();
    for electrode in 0..moment.nrows() {
        moment[(electrode, electrode)] += penalty;
    }
    let inverse = moment.cholesky()?.inverse();
    let weight = |electrode, other| {
        if electrode == other {
            return 0.0;
        }
        -inverse[(electrode, other)] / inverse[(electrode, electrode)]
    };
    Some(DMatrix::from_fn(inverse.nrows(), inverse.ncols(), weight))
}

/// Returns the mean square of one electrode's values in each whole second.
pub fn seconds<'v>(values: impl Iterator<Item = &'v f64>) -> Vec<f64> {
    let squares: Vec<f64> = values.map(|value| value.powi(2)).collect();
    let seconds = squares.chunks_exact(SECOND);
    let mean = |second: &[f64]| second.iter().sum::<f64>() / SECOND as f64;
    seconds.map(mean).collect()
}

/// Returns the difference between electrodes and their predictions, uV, `[electrode, step]`.
pub fn residual(prediction: &DMatrix<f64>, track: &Track) -> DMatrix<f64> {
    let mut residual = columns(track).map(f64::from);
    let steps = residual.clone();
    residual.gemm(-1.0, prediction, &steps, 1.0);
    residual
}

/// Returns the time steps of a track as the columns of a matrix, uV.
pub fn columns(track: &Track) -> DMatrix<f32> {
    DMatrix::from_column_slice(track.electrodes, track.steps(), &track.values)
}

/// Returns the median of numbers: the mean of the two middle numbers if their count is even.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let count = values.len();
    f64::midpoint(values[(count - 1) / 2], values[count / 2])
}
