//! Bits and error of a packed model at each rate.

use crate::coded;
use crate::error::FitError;
use crate::in_parallel;
use crate::integers::{Scale, analysed};
use crate::ridge::next_residuals;
use crate::track::Track;
use crate::transform::{Blocks, to_f32};
use artifact::{Description, PackedFigures, PackedModel, reconstruction};
use nalgebra::DMatrix;
use packed::Rate;

/// Number of blocks from one block without prediction to the next, as on a device: 4 s if a block
/// has eight steps.
const RESET: usize = 64;

/// Number of blocks at each end of a sequence that are excluded from errors: at the start, the
/// state has not settled; at the end, there is no next block to smooth with.
const EDGE: usize = 4;

/// Bits and error at one rate, measured on recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateFigures {
    /// Rate of the packed code, 0 (finest) to 15 (coarsest).
    pub rate: u8,
    /// Mean number of bits of a block, 8 times its length in bytes.
    pub bits: f64,
    /// Length of the longest block in bytes.
    pub longest: usize,
    /// Mean squared error of the signal decoded from each block when it arrives, in units of
    /// `input.sd_uv` squared.
    pub mse: f64,
    /// Mean squared error of the signal smoothed by the next block, which arrives a hop later, in
    /// units of `input.sd_uv` squared.
    pub mse_smoothed: f64,
}

impl RateFigures {
    /// Returns the figures, rounded as in `packed.toml`.
    pub fn rounded(self) -> PackedFigures {
        let to = |digits: f64, value: f64| (value * digits).round() / digits;
        PackedFigures {
            rate: self.rate,
            bits: to(10.0, self.bits),
            mse: to(1e6, self.mse),
            mse_smoothed: to(1e6, self.mse_smoothed),
        }
    }
}

/// Measures a packed model on tracks at every rate, finest first. Passes the smoothed signals of
/// each rate to `observe`, one matrix for each track, in units of `input.sd_uv`.
///
/// # Errors
/// If the directions of the analysis are linearly dependent.
pub fn evaluate(
    model: &PackedModel,
    tracks: &[Track],
    description: &Description,
    observe: &mut dyn FnMut(&[DMatrix<f32>]),
) -> Result<Vec<RateFigures>, FitError> {
    evaluate_with_resets(model, tracks, description, RESET, observe)
}

/// Measures a packed model like [`evaluate`], but codes every `reset`-th block without
/// prediction.
pub(crate) fn evaluate_with_resets(
    model: &PackedModel,
    tracks: &[Track],
    description: &Description,
    reset: usize,
    observe: &mut dyn FnMut(&[DMatrix<f32>]),
) -> Result<Vec<RateFigures>, FitError> {
    let sd_uv = description.input.sd_uv;
    let blocks = Blocks::cut(tracks, description.window.hop, sd_uv, &[0]);
    let coefficients = analysed(model, &blocks, sd_uv);
    let synthesis = reconstruction::synthesis(model);
    if synthesis.iter().any(|value| !value.is_finite()) {
        return Err(FitError::Silent);
    }
    let count = model.coefficients();
    let synthesis = DMatrix::from_column_slice(synthesis.len() / count, count, &synthesis);
    let synthesis = to_f32(&synthesis);
    let scale = Scale::new(model, sd_uv);
    let figures = Rate::all().map(|rate| {
        let coded = coded::code(model, &coefficients, rate, reset);
        let smoother = DMatrix::from_row_slice(count, count, &model.smoother.matrix(rate.index()));
        let decoded = in_parallel::map(&coded, |coded| {
            let own = scale.columns(&coded.states);
            let next = next_residuals(model, &coded.states, scale);
            let mut smoothed = own.clone();
            let mut inner = smoothed.columns_mut(0, next.ncols());
            inner += &smoother * next;
            (&synthesis * own, &synthesis * smoothed)
        });
        let (at_once, smoothed): (Vec<_>, Vec<_>) = decoded.into_iter().unzip();
        observe(&smoothed);
        let lengths = || coded.iter().flat_map(|coded| &coded.bytes);
        RateFigures {
            rate: rate.index(),
            bits: 8.0 * lengths().sum::<usize>() as f64 / lengths().count().max(1) as f64,
            longest: lengths().copied().max().unwrap_or(0),
            mse: mean_squared_error(&blocks.sequences, &at_once),
            mse_smoothed: mean_squared_error(&blocks.sequences, &smoothed),
        }
    });
    Ok(figures.collect())
}

/// Returns the mean squared error of decoded sequences, without the [`EDGE`] blocks at both ends of
/// each sequence.
fn mean_squared_error(original: &[DMatrix<f32>], decoded: &[DMatrix<f32>]) -> f64 {
    let (mut error, mut values) = (0.0, 0.0_f64);
    for (original, decoded) in original.iter().zip(decoded) {
        let counted = original.ncols().saturating_sub(2 * EDGE);
        let original = original.columns(EDGE.min(original.ncols()), counted);
        let difference = decoded.columns(EDGE.min(decoded.ncols()), counted) - original;
        let squares = difference.iter().map(|&d| f64::from(d).powi(2));
        error += squares.sum::<f64>();
        values += original.len() as f64;
    }
    error / values.max(1.0)
}
