//! The transform of a block and the prediction of the next block, in floats.

use crate::directions::{principal_directions, second_moment};
use crate::error::FitError;
use crate::ridge::{PENALTY, Ridge};
use crate::track::Track;
use nalgebra::{DMatrix, DVector};

/// Number of rounds, each of which fits the prediction to decoded states and rotates the transform
/// to the prediction's residual.
const ROUNDS: usize = 2;

/// Step of the dead-zone quantiser that stands for the device's quantiser during the fit, in units
/// of `input.sd_uv`. With [`ROUNDING`], its error is about that of rate 4.
const STEP: f32 = 0.6;

/// Part of a [`STEP`] that is added to a magnitude before rounding down.
const ROUNDING: f32 = 0.35;

/// Consecutive blocks of one or several recordings. A block is a hop of time steps.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    /// One matrix for each sequence: each column is a block, in the order step, electrode, in units
    /// of `input.sd_uv`.
    pub(crate) sequences: Vec<DMatrix<f32>>,
}

impl Blocks {
    /// Cuts tracks into blocks of `hop` steps, once for each offset. An offset is the step at which
    /// the first block begins; with several, the statistics do not depend on this step.
    pub(crate) fn cut(tracks: &[Track], hop: usize, sd_uv: f64, offsets: &[usize]) -> Self {
        let sequences = offsets.iter().flat_map(|&offset| {
            tracks.iter().map(move |track| {
                let block = hop * track.electrodes;
                let values = track.values.get(offset * track.electrodes..).unwrap_or(&[]);
                let count = values.len() / block;
                let scaled = values.iter().map(|&uv| {
                    #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
                    let value = (f64::from(uv) / sd_uv) as f32;
                    value
                });
                DMatrix::from_iterator(block, count, scaled.take(count * block))
            })
        });
        Self {
            sequences: sequences.collect(),
        }
    }
}

/// Orthonormal directions of a block, and the prediction of the next block.
#[derive(Clone, Debug)]
pub(crate) struct Transform {
    /// Directions, `[value, coefficient]`; the first coefficient has the largest residual.
    pub(crate) directions: DMatrix<f64>,
    /// Prediction of a block's coefficients from those of the block before it, `[coefficient,
    /// coefficient before]`.
    pub(crate) prediction: DMatrix<f64>,
}

impl Transform {
    /// Fits a transform with `count` coefficients to blocks: the subspace with the most energy,
    /// rotated until the prediction's residuals of different coefficients are uncorrelated.
    pub(crate) fn fit(blocks: &Blocks, count: usize) -> Result<Self, FitError> {
        let mut transform = Self::without_prediction(blocks, count);
        let mut coefficients = transform.coefficients(blocks);
        transform.fit_prediction(&coefficients, &coefficients)?;
        for _ in 0..ROUNDS {
            let states: Vec<_> = coefficients.iter().map(|c| transform.decoded(c)).collect();
            transform.fit_prediction(&states, &coefficients)?;
            let residuals: Vec<_> = states
                .iter()
                .zip(&coefficients)
                .map(|(states, coefficients)| transform.residual(states, coefficients))
                .collect();
            let turn = to_matrix(&principal_directions(second_moment(&residuals), count));
            transform.directions = &transform.directions * &turn;
            transform.prediction = turn.transpose() * &transform.prediction * &turn;
            coefficients = transform.coefficients(blocks);
        }
        Ok(transform)
    }

    /// Fits the Karhunen-Loeve transform with `count` coefficients to blocks. The prediction is 0.
    pub(crate) fn without_prediction(blocks: &Blocks, count: usize) -> Self {
        let directions = principal_directions(second_moment(&blocks.sequences), count);
        Self {
            directions: to_matrix(&directions),
            prediction: DMatrix::zeros(count, count),
        }
    }

    /// Returns the mean square, over all values of blocks, of what the coefficients do not
    /// represent, in units of `input.sd_uv` squared.
    pub(crate) fn unrepresented(&self, blocks: &Blocks) -> f64 {
        let energy = |matrices: &[DMatrix<f32>]| {
            let values = matrices.iter().flatten();
            values.map(|value| f64::from(*value).powi(2)).sum::<f64>()
        };
        let count: usize = blocks.sequences.iter().map(DMatrix::len).sum();
        // The directions are orthonormal: what they do not represent is orthogonal to the rest.
        let left = energy(&blocks.sequences) - energy(&self.coefficients(blocks));
        left.max(0.0) / count.max(1) as f64
    }

    fn coefficients(&self, blocks: &Blocks) -> Vec<DMatrix<f32>> {
        let analysis = to_f32(&self.directions.transpose());
        blocks
            .sequences
            .iter()
            .map(|blocks| &analysis * blocks)
            .collect()
    }

    /// Fits the prediction of each block's coefficients from the state before it.
    fn fit_prediction(
        &mut self,
        states: &[DMatrix<f32>],
        coefficients: &[DMatrix<f32>],
    ) -> Result<(), FitError> {
        let count = self.prediction.nrows();
        let mut ridge = Ridge::new(count, count);
        for (states, coefficients) in states.iter().zip(coefficients) {
            let last = states.ncols().saturating_sub(1);
            ridge.add(states.columns(0, last), coefficients.columns(1, last));
        }
        self.prediction = ridge.solve(PENALTY)?;
        Ok(())
    }

    /// Encodes a sequence with a dead-zone quantiser, predicting each block from the decoded state
    /// before it, and returns the decoded states.
    fn decoded(&self, coefficients: &DMatrix<f32>) -> DMatrix<f32> {
        let prediction = to_f32(&self.prediction);
        let mut states = DMatrix::zeros(coefficients.nrows(), coefficients.ncols());
        let mut state = DVector::zeros(coefficients.nrows());
        for (coefficients, mut decoded) in coefficients.column_iter().zip(states.column_iter_mut())
        {
            let mut next = &prediction * &state;
            for (next, &coefficient) in next.iter_mut().zip(&coefficients) {
                let residual = coefficient - *next;
                let magnitude = (residual.abs() / STEP + ROUNDING).floor() * STEP;
                *next += magnitude.copysign(residual);
            }
            decoded.copy_from(&next);
            state = next;
        }
        states
    }

    fn residual(&self, states: &DMatrix<f32>, coefficients: &DMatrix<f32>) -> DMatrix<f32> {
        let last = states.ncols().saturating_sub(1);
        let predicted = to_f32(&self.prediction) * states.columns(0, last);
        coefficients.columns(1, last) - predicted
    }
}

/// Returns a matrix whose columns are `directions`.
fn to_matrix(directions: &[Vec<f32>]) -> DMatrix<f64> {
    let rows = directions.first().map_or(0, Vec::len);
    let values = directions.iter().flatten().map(|&value| f64::from(value));
    DMatrix::from_iterator(rows, directions.len(), values)
}

#[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
pub(crate) fn to_f32(matrix: &DMatrix<f64>) -> DMatrix<f32> {
    matrix.map(|value| value as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn what_the_coefficients_lack_is_the_error_of_the_decoded_blocks() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let values = (0..2400).map(|index| rng.random_range(-1.0..1.0) * (1 + index % 8) as f32);
        let track = Track::new("noise", 2, values.collect());
        let blocks = Blocks::cut(&[track], 4, 2.0, &[0, 2]);
        let transform = Transform::fit(&blocks, 3).unwrap();
        let directions = to_f32(&transform.directions);
        let (mut error, mut count) = (0.0, 0.0);
        for blocks in &blocks.sequences {
            let left = blocks - &directions * directions.transpose() * blocks;
            error += left.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            count += left.len() as f64;
        }
        assert!(error > 0.1 * count);
        let unrepresented = transform.unrepresented(&blocks);
        assert!((unrepresented / (error / count) - 1.0).abs() < 1e-4);
    }
}
