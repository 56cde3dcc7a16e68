//! Trains a packed model and measures it at all rates.

use super::{FitOptions, Tracks};
use crate::error::TrainerError;
use crate::progress::ProgressObserver;
use artifact::{Description, ErrorWeight, PackedModel};
use packed_fit::{RateFigures, evaluate, fit, without_prediction};

/// Figures of a trained packed model on the test recordings or, without test recordings, on the
/// training recordings.
#[derive(Clone, Debug)]
pub(crate) struct PackedTrained {
    /// Figures of the model at each rate, finest first.
    pub(crate) figures: Vec<RateFigures>,
    /// For comparison, figures of the Karhunen-Loeve transform of a block, coded in the same way
    /// but without prediction.
    pub(crate) without_prediction: Vec<RateFigures>,
}

/// Fits a packed model with `count` coefficients, and returns it with its figures.
///
/// # Errors
/// If the recordings do not determine a model, or no rate reaches the requested error.
pub(super) fn train(
    tracks: &Tracks,
    description: &Description,
    count: usize,
    options: FitOptions,
    observer: &mut impl ProgressObserver,
) -> Result<(PackedModel, PackedTrained), TrainerError> {
    let weight = options.weight.map(|weight| ErrorWeight {
        strength: options.strength.unwrap_or(weight.strength),
        ..weight
    });
    let mut model = fit(&tracks.train, description, count, weight, &mut |text| {
        observer.message(text);
    })?;
    let tested = if tracks.test.is_empty() {
        observer.message("no test recordings: the figures are those of the training recordings");
        &tracks.train
    } else {
        &tracks.test
    };
    let figures = evaluate(&model, tested, description, &mut |_| ())?;
    if let Some(target) = options.target_mse {
        let rate = coarsest_within(&figures, target)?;
        model.description.rate = rate;
        observer.message(&format!("rate {rate} is the coarsest with an error of at most {target}"));
    }
    observer.message("fitting the transform without prediction, to compare ...");
    let without = without_prediction(&model, &tracks.train, tested, description)?;
    if !tracks.test.is_empty() {
        let rounded =
            |figures: &[RateFigures]| figures.iter().map(|figures| figures.rounded()).collect();
        let card = &mut model.description.training;
        card.figures = rounded(&figures);
        card.without_prediction = rounded(&without);
    }
    let trained = PackedTrained { figures, without_prediction: without };
    Ok((model, trained))
}

/// Returns the coarsest rate whose error without smoothing is at most `target`.
fn coarsest_within(figures: &[RateFigures], target: f64) -> Result<u8, TrainerError> {
    let within = figures.iter().rev().find(|figures| figures.mse <= target);
    within.map(|figures| figures.rate).ok_or_else(|| {
        let least = figures.iter().map(|figures| figures.mse).fold(f64::INFINITY, f64::min);
        TrainerError::TargetOutOfReach { target, least }
    })
}
