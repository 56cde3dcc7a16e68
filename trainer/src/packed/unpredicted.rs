//! The transform without prediction, coded alike: what the prediction is worth.

use super::blocks::Blocks;
use super::coded;
use super::evaluation::{self, RateFigures};
use super::integers::{self, analysed};
use super::probabilities;
use super::transform::Transform;
use crate::error::TrainerError;
use crate::track::Track;
use artifact::{Description, PackedModel, slice_ends};
use packed::Rate;

/// Rounds of coding the training blocks and counting magnitudes.
const ROUNDS: usize = 4;

/// Every block is one without prediction.
const RESET: usize = 1;

/// Fits the Karhunen-Loeve transform of a block with as many coefficients as `model` to `tracks`, with quantiser,
/// contexts and range coder of the packed code and every block without prediction. Returns its figures on `tested` at
/// every rate, finest first.
///
/// # Errors
/// If the recordings are silent.
pub(super) fn figures(
    model: &PackedModel,
    tracks: &[Track],
    tested: &[Track],
    description: &Description,
) -> Result<Vec<RateFigures>, TrainerError> {
    let (hop, sd_uv) = (description.window.hop, description.input.sd_uv);
    let electrodes = description.montage.electrodes.len();
    let every_quarter: Vec<usize> = (0..hop).step_by((hop / 4).max(1)).collect();
    let blocks = Blocks::cut(tracks, hop, sd_uv, &every_quarter);
    let transform = Transform::without_prediction(&blocks, model.coefficients());
    let mut model = PackedModel {
        analysis: integers::analysis(&transform, &slice_ends(electrodes, hop)),
        ..model.clone()
    };
    let blocks = Blocks::cut(tracks, hop, sd_uv, &[0, hop / 2]);
    let coefficients = analysed(&model, &blocks, sd_uv);
    let two_steps = 2.0 * f64::from(Rate::MIDDLE.step());
    let mut means = probabilities::mean_sizes(&coefficients, model.coefficients(), two_steps);
    for _ in 0..ROUNDS {
        model.reset_levels = probabilities::levels(&means);
        let coded = coded::code(&model, &coefficients, Rate::MIDDLE, RESET);
        model.starts = probabilities::starts(&coded::sum(&coded));
        means = probabilities::mean_magnitudes(&coded, model.coefficients());
    }
    model.reset_levels = probabilities::levels(&means);
    let figures = evaluation::evaluate_with_resets(&model, tested, description, RESET)?;
    // No block says anything about the one before it.
    let alone = |figures: RateFigures| RateFigures {
        mse_smoothed: figures.mse,
        ..figures
    };
    Ok(figures.into_iter().map(alone).collect())
}
