//! Transform and prediction as integers of proven ranges.

use super::transform::Transform;
use artifact::IntegerMatrix;
use nalgebra::DMatrix;

/// Microvolts of one unit of an input value. Its rounding adds 1e-5 to the mean squared error of EEG.
pub(super) const INPUT_UV: f64 = 0.5;

/// Microvolts of one unit of a coefficient.
pub(super) const COEFFICIENT_UV: f64 = 0.5;

/// Largest magnitude of an input value: 2 mV. It takes 12 bits, so that the sums of a slice of inputs stay
/// below 2^23.
pub(super) const INPUT_LIMIT: i16 = 4095;

/// Largest magnitude of a rounded coefficient of the state.
const STATE_LIMIT: f64 = 4096.0;

/// Units of the state in one unit of a rounded one.
const STATE_UNIT: f64 = 8.0;

/// The kernels recover the sums of two outputs from one, which needs them below this.
const SUM_LIMIT: f64 = 8_388_607.0;

/// Returns the analysis of blocks in integers. `slices` are the ends of the inputs that the device adds at
/// each step.
pub(super) fn analysis(transform: &Transform, slices: &[usize]) -> IntegerMatrix {
    let directions = &transform.directions;
    IntegerMatrix::quantised(
        directions.as_slice(),
        directions.nrows(),
        INPUT_UV / COEFFICIENT_UV,
        |weights| {
            let mut start = 0;
            let slices = slices.iter().map(|&end| {
                let slice = &weights[start..end];
                start = end;
                scale_for(slice, INPUT_LIMIT.into())
            });
            slices.fold(f64::INFINITY, f64::min)
        },
    )
}

/// Returns the prediction in integers.
pub(super) fn prediction(prediction: &DMatrix<f64>) -> IntegerMatrix {
    let rows = prediction.transpose();
    IntegerMatrix::quantised(rows.as_slice(), rows.nrows(), STATE_UNIT, |weights| {
        scale_for(weights, STATE_LIMIT)
    })
}

/// Returns the largest scale with which rounded weights times inputs up to `limit` sum to at most
/// [`SUM_LIMIT`].
fn scale_for(weights: &[f64], limit: f64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "at most a few hundred")]
    let rounding = 0.5 * weights.len() as f64;
    let sum: f64 = weights.iter().map(|weight| weight.abs()).sum();
    ((SUM_LIMIT / limit).floor() - rounding) / sum.max(1e-12)
}
