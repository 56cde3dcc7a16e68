//! The transform of a block and the prediction of the next block, in floats.

use crate::directions::{principal_directions, second_moment};
use crate::error::FitError;
use crate::ridge::{PENALTY, Ridge};
use crate::track::Track;
use crate::weight::Metric;
use nalgebra::{DMatrix, DVector};
use packed::{PROBE_SHIFT, PROBES};

/// Number of rounds. Each round fits the prediction to decoded states and rotates the directions to
/// the principal directions of the prediction's residual.
const ROUNDS: usize = 2;

/// Step of the dead-zone quantiser that replaces the device's quantiser during the fit, in units of
/// `input.sd_uv`. With [`ROUNDING`], its error is about the error of the device's quantiser at rate
/// 4.
const STEP: f32 = 0.6;

/// Fraction of a [`STEP`] that is added to a magnitude before rounding down.
const ROUNDING: f32 = 0.35;

/// Power below which a direction of a block is quiet, relative to the mean power of a value. With
/// this ratio, the probes detect noise on one electrode and exchanged electrodes in EEGMMIDB S001
/// to S008 at least as often as an unweighted model detects them by its unrepresented energy.
const QUIET: f64 = 0.01;

/// Consecutive blocks of one or several recordings. A block is a hop of time steps.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    /// One matrix for each sequence: each column is a block, in the order step, electrode, in units
    /// of `input.sd_uv`.
    pub(crate) sequences: Vec<DMatrix<f32>>,
}

impl Blocks {
    /// Cuts tracks into blocks of `hop` steps, once for each offset, the step at which the first
    /// block begins. With several offsets, the statistics do not depend on where blocks begin.
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
        Self { sequences: sequences.collect() }
    }
}

/// Directions of a block, and the prediction of the next block.
#[derive(Clone, Debug)]
pub(crate) struct Transform {
    /// Directions, `[value, coefficient]`, sorted by the energy of the prediction's residual,
    /// largest first. Orthonormal unless errors are weighted; with weighted errors, the last
    /// directions are the probes.
    pub(crate) directions: DMatrix<f64>,
    /// Prediction of a block's coefficients from the previous block's coefficients,
    /// `[coefficient, previous coefficient]`.
    pub(crate) prediction: DMatrix<f64>,
}

impl Transform {
    /// Fits a transform with `count` coefficients to blocks: the subspace with the most energy,
    /// rotated until the prediction's residuals of different coefficients are uncorrelated.
    pub(crate) fn fit(blocks: &Blocks, count: usize) -> Result<Self, FitError> {
        Self::without_prediction(blocks, count).with_prediction(blocks)
    }

    /// Fits a transform like [`Self::fit`], but in the space in which `metric` is the sum of
    /// squares, and appends [`PROBES`] directions with little signal ([`quiet_probes`]). `theta` is
    /// the mean squared error of a coefficient at the base rate, in units of `input.sd_uv` squared.
    pub(crate) fn fit_weighted(
        blocks: &Blocks,
        count: usize,
        metric: &Metric,
        electrodes: usize,
        theta: f64,
    ) -> Result<Self, FitError> {
        let moment = second_moment(&blocks.sequences);
        let root = metric.root();
        let weighted = &root * &moment * &root;
        let signals = to_matrix(&principal_directions(weighted.clone(), count - PROBES));
        let plain = moment.symmetric_eigenvalues();
        let gain = gain_at_equal_bits(&plain, &weighted.symmetric_eigenvalues(), theta);
        let mut transform = Self {
            directions: &root * &signals * gain,
            prediction: DMatrix::zeros(count - PROBES, count - PROBES),
        };
        transform = transform.with_prediction(blocks)?;
        let mut directions = transform.directions.resize_horizontally(count, 0.0);
        let mut probes = directions.columns_mut(count - PROBES, PROBES);
        probes.copy_from(&quiet_probes(moment, count - PROBES, electrodes)?);
        transform.directions = directions;
        transform.prediction = transform.prediction.resize(count, count, 0.0);
        Ok(transform)
    }

    /// Fits the prediction, and rotates the directions to its residuals' principal directions.
    fn with_prediction(mut self, blocks: &Blocks) -> Result<Self, FitError> {
        let count = self.prediction.nrows();
        let mut coefficients = self.coefficients(blocks);
        self.fit_prediction(&coefficients, &coefficients)?;
        for _ in 0..ROUNDS {
            let states: Vec<_> = coefficients.iter().map(|c| self.decoded(c)).collect();
            self.fit_prediction(&states, &coefficients)?;
            let residuals: Vec<_> = states
                .iter()
                .zip(&coefficients)
                .map(|(states, coefficients)| self.residual(states, coefficients))
                .collect();
            let turn = to_matrix(&principal_directions(second_moment(&residuals), count));
            self.directions = &self.directions * &turn;
            self.prediction = turn.transpose() * &self.prediction * &turn;
            coefficients = self.coefficients(blocks);
        }
        Ok(self)
    }

    /// Fits the Karhunen-Loeve transform with `count` coefficients to blocks. The prediction is 0.
    pub(crate) fn without_prediction(blocks: &Blocks, count: usize) -> Self {
        let directions = principal_directions(second_moment(&blocks.sequences), count);
        Self { directions: to_matrix(&directions), prediction: DMatrix::zeros(count, count) }
    }

    /// Returns the mean square, over all values of blocks, of the part that the coefficients do not
    /// represent, in units of `input.sd_uv` squared.
    pub(crate) fn unrepresented(&self, blocks: &Blocks, is_weighted: bool) -> f64 {
        let energy = |matrices: &[DMatrix<f32>]| {
            let values = matrices.iter().flatten();
            values.map(|value| f64::from(*value).powi(2)).sum::<f64>()
        };
        let count: usize = blocks.sequences.iter().map(DMatrix::len).sum();
        let coefficients = self.coefficients(blocks);
        let left = if is_weighted {
            let probes = coefficients.iter().map(|c| c.rows(c.nrows() - PROBES, PROBES));
            let probes: Vec<_> = probes.map(DMatrix::from).collect();
            f64::from(1 << PROBE_SHIFT) * energy(&probes)
        } else {
            // The directions are orthonormal, so the energy of the part that they do not represent
            // is the blocks' energy minus the coefficients' energy.
            energy(&blocks.sequences) - energy(&coefficients)
        };
        left.max(0.0) / count.max(1) as f64
    }

    fn coefficients(&self, blocks: &Blocks) -> Vec<DMatrix<f32>> {
        let analysis = to_f32(&self.directions.transpose());
        blocks.sequences.iter().map(|blocks| &analysis * blocks).collect()
    }

    /// Fits the prediction of each block's coefficients from the previous block's state.
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

    /// Encodes a sequence with a dead-zone quantiser, predicting each block from the previous
    /// decoded state, and returns the decoded states.
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

/// Returns the factor by which the weighted space is scaled so that its transform takes as many
/// bits as the plain transform. By reverse water-filling, each coefficient with a power above
/// `theta` has an error of `theta`. `plain` and `weighted` are the second moments along principal
/// directions.
fn gain_at_equal_bits(plain: &DVector<f64>, weighted: &DVector<f64>, theta: f64) -> f64 {
    let bits = |moments: &DVector<f64>, factor: f64| -> f64 {
        let moments = moments.iter().map(|moment| moment * factor / theta);
        moments.map(|ratio| 0.5 * ratio.max(1.0).log2()).sum()
    };
    let wanted = bits(plain, 1.0);
    let (mut low, mut high) = (-40.0_f64, 40.0_f64);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if bits(weighted, middle.exp2()) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    low.exp2().sqrt()
}

/// Returns [`PROBES`] orthogonal directions in which an electrode's noise is large and the signals
/// with the second moment `moment` are small: `(moment + floor)^-1 N r`, where N is the second
/// moment of low-pass noise of equal power at each electrode, and r is random. Their length is such
/// that, for noise in all directions, the probes' energy times `2^PROBE_SHIFT` equals the energy
/// that `represented` coefficients do not represent.
fn quiet_probes(
    mut moment: DMatrix<f64>,
    represented: usize,
    electrodes: usize,
) -> Result<DMatrix<f64>, FitError> {
    let values = moment.nrows();
    let mut state = 1_u32;
    let mut noise = DMatrix::from_fn(values, PROBES, |_, _| {
        // The generator of Numerical Recipes; its highest bit is a fair sign.
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        if state >> 31 == 0 { 1.0 } else { -1.0 }
    });
    for _ in 0..2 {
        // Weights of 1/4, 1/2 and 1/4 for three steps: a low-pass that is 0 at half the step rate.
        let before = noise.clone();
        noise = noise.map_with_location(|value, probe, x| {
            let earlier = value.checked_sub(electrodes).map(|at| before[(at, probe)]);
            let later = before.get((value + electrodes, probe)).copied();
            (2.0 * x + earlier.unwrap_or(0.0) + later.unwrap_or(0.0)) / 4.0
        });
    }
    let floor = QUIET * moment.trace() / values as f64;
    moment += DMatrix::identity(values, values) * floor;
    let probes = moment.cholesky().ok_or(FitError::Silent)?.solve(&noise);
    let energy = (values - represented) as f64 / (PROBES << PROBE_SHIFT) as f64;
    Ok(probes.qr().q() * energy.sqrt())
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
        let unrepresented = transform.unrepresented(&blocks, false);
        assert!((unrepresented / (error / count) - 1.0).abs() < 1e-4);
    }
}
