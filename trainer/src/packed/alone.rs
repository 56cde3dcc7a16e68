//! `trainer packed --montage`: a model with the packed code alone.

use super::fit::{self, FitOptions, PackedTrained, Selected};
use crate::card::{self, Shape};
use crate::dataset::Dataset;
use crate::error::TrainerError;
use crate::output_folder::check_writable;
use crate::progress::ProgressObserver;
use crate::track::settling_steps;
use artifact::{Artifact, CodeFormat, Mode, MontageFile, Padding};
use std::path::PathBuf;

/// Number of time steps that `model.toml` states for a window, which only a network reads.
const STEPS: usize = 16;

/// Options of `trainer packed` for a model without a network.
#[derive(Clone, Debug)]
pub struct AloneOptions {
    /// Grid, order of the ADC's channels and ADC.
    pub montage: MontageFile,
    /// Time steps of a block: 4, 8 or 16.
    pub hop: usize,
    /// Recordings to train on and to test with, and settings of the fit.
    pub fit: FitOptions,
    /// Origin and licence of the recordings, for the training card.
    pub dataset: String,
    /// References to cite, for the training card.
    pub citation: String,
    /// Folder to write the artifact to.
    pub out: PathBuf,
    /// True to replace an artifact in `out`.
    pub force: bool,
}

/// Trains a model with the packed code alone, writes its artifact and returns its figures.
///
/// # Errors
/// If the montage has mistakes, recordings cannot be used, the wanted error cannot be reached or files cannot be
/// written.
pub fn train_alone(
    options: &AloneOptions,
    observer: &mut impl ProgressObserver,
) -> Result<PackedTrained, TrainerError> {
    if !options.force && options.out.join("model.toml").exists() {
        let folder = options.out.clone();
        return Err(TrainerError::ArtifactExists { folder });
    }
    let shape = Shape {
        mode: Mode::Packed,
        numbers: 0,
        steps: STEPS,
        hop: options.hop,
        padding: Padding::None,
        format: CodeFormat::Int8,
    };
    let mut description = card::checked_description(&options.montage, shape)?;
    let count = fit::coefficients(options.fit.coefficients, &description)?;
    let selected = Selected::find(&options.fit)?;
    check_writable(&options.out)?;
    let mains_hz = options.fit.mains_hz;
    let tracks = selected.read(&description, mains_hz, observer)?;
    let whole = Dataset::from_tracks(&tracks.train, description.dimensions())?;
    let sd_uv = whole.deviation();
    if sd_uv <= 0.0 {
        return Err(TrainerError::Silent);
    }
    observer.message(&format!(
        "standard deviation of the training recordings: {sd_uv:.2} uV"
    ));
    description.input.sd_uv = sd_uv;
    let target_mse = options.fit.target_mse;
    let (mut model, trained) = fit::fit(&tracks, &description, count, target_mse, observer)?;
    let [train_files, test_files] = selected.names();
    let settling = settling_steps(&description, mains_hz)?;
    let card = &mut description.training;
    card::fill_electrodes(card, &description.montage.electrodes, &tracks.train);
    card.dataset.clone_from(&options.dataset);
    card.citation.clone_from(&options.citation);
    card.train_files.clone_from(&train_files);
    card.test_files.clone_from(&test_files);
    card.validation = card::validation(None, settling, description.window.rate_hz);
    card.mains_hz = mains_hz;
    "none: transform of the signals' covariance, prediction by ridge regression"
        .clone_into(&mut card.optimiser);
    let card = &mut model.description.training;
    (card.train_files, card.test_files) = (train_files, test_files);
    let id = Artifact::without_network(description, whole.max_abs(), model)?.write(&options.out)?;
    observer.message(&format!("model {id} written to {}", options.out.display()));
    Ok(trained)
}
