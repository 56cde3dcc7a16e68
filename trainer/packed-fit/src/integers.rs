//! Converts transform and prediction to integers whose sums provably stay in range, and back to
//! floats.

use crate::in_parallel;
use crate::transform::{Blocks, Transform};
use artifact::{IntegerMatrix, LARGEST_STATE, PackedModel, SUM_LIMIT};
use nalgebra::DMatrix;

/// Size of one unit of an input value, and of a coefficient, in microvolts. Rounding inputs to this
/// unit adds 1e-5 to the mean squared error of EEG.
pub(crate) const UNIT_UV: f64 = 0.5;

/// Largest magnitude of an input value, 2 mV in units of [`UNIT_UV`]. It takes 12 bits, so that the
/// sums of a slice of inputs stay below 2^23.
pub(crate) const INPUT_LIMIT: i16 = 4095;

/// Lower limit of the sum of weight magnitudes by which a scale is divided. It keeps the scale of
/// weights that are all 0 finite.
const SMALLEST_SUM: f64 = 1e-12;

/// Number of state units in one unit of the rounded state, from which blocks are predicted.
const STATE_UNIT: f64 = 8.0;

/// Returns the matrix that analyses blocks, in integers. `slices` holds the end of each slice of a
/// block's inputs; the device processes one slice at each step.
pub(crate) fn analysis(transform: &Transform, slices: &[usize]) -> IntegerMatrix {
    let directions = &transform.directions;
    IntegerMatrix::quantised(directions.as_slice(), directions.nrows(), 1.0, |weights| {
        let mut start = 0;
        let slices = slices.iter().map(|&end| {
            let slice = &weights[start..end];
            start = end;
            scale_for(slice, INPUT_LIMIT)
        });
        slices.fold(f64::INFINITY, f64::min)
    })
}

/// Returns the limit for the sum of the magnitudes of the `count` weights that predict a
/// coefficient. Above it, the factor that undoes the scale of the integer weights would be 1/2 or
/// more, which an [`IntegerMatrix`] cannot hold.
pub(crate) fn largest_prediction(count: usize) -> f64 {
    scale_for(&vec![0.0; count], LARGEST_STATE) * SMALLEST_SUM / (2.0 * STATE_UNIT)
}

/// Returns the matrix of the prediction as integers. Rows whose sum of magnitudes exceeds
/// [`largest_prediction`] are scaled down to this limit.
pub(crate) fn prediction(prediction: &DMatrix<f64>) -> IntegerMatrix {
    let largest = largest_prediction(prediction.ncols());
    let mut rows = prediction.transpose();
    for mut weights in rows.column_iter_mut() {
        let sum = weights.lp_norm(1);
        if sum > largest {
            weights *= largest / sum;
        }
    }
    IntegerMatrix::quantised(rows.as_slice(), rows.nrows(), STATE_UNIT, |weights| {
        scale_for(weights, LARGEST_STATE)
    })
}

/// Returns the largest scale with which the sum of scaled and rounded weights times inputs does not
/// exceed [`SUM_LIMIT`], for inputs of magnitude up to `limit`.
fn scale_for(weights: &[f64], limit: i16) -> f64 {
    let (most, rounding) = ((SUM_LIMIT / i64::from(limit)) as f64, 0.5 * weights.len() as f64);
    let sum: f64 = weights.iter().map(|weight| weight.abs()).sum();
    (most - rounding) / sum.max(SMALLEST_SUM)
}

/// Returns the integer coefficients of all blocks, one block after the other in each sequence.
pub(crate) fn analysed(model: &PackedModel, blocks: &Blocks, sd_uv: f64) -> Vec<Vec<i16>> {
    let limit = f64::from(INPUT_LIMIT);
    in_parallel::map(&blocks.sequences, |blocks| {
        let block = |values: nalgebra::DVectorView<'_, f32>| {
            let inputs: Vec<i16> = values
                .iter()
                .map(|&value| {
                    let value = (f64::from(value) * sd_uv / UNIT_UV).round();
                    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
                    let value = value.clamp(-limit, limit) as i16;
                    value
                })
                .collect();
            model.analyse(&inputs)
        };
        blocks.column_iter().flat_map(block).collect()
    })
}

/// Converts integer coefficients to columns of a matrix, in units of `input.sd_uv`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    /// Number of coefficients of a block.
    pub(crate) count: usize,
    /// Size of one unit of a coefficient, in units of `input.sd_uv`.
    unit: f64,
}

impl Scale {
    pub(crate) fn new(model: &PackedModel, sd_uv: f64) -> Self {
        Self { count: model.coefficients(), unit: model.description.unit_uv / sd_uv }
    }

    /// Returns `values`, the coefficients of consecutive blocks, as a matrix with a column for each
    /// block.
    pub(crate) fn columns(self, values: &[i16]) -> DMatrix<f32> {
        #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
        let scaled = values.iter().map(|&value| (f64::from(value) * self.unit) as f32);
        DMatrix::from_iterator(self.count, values.len() / self.count, scaled)
    }
}
