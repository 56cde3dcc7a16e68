//! `trainer packed`: fits a packed model to recordings, and adds it to an artifact.

use super::evaluation::{self, RateFigures};
use super::fit::{self, FitOptions, PackedTrained, Selected};
use crate::error::TrainerError;
use crate::output_folder::check_writable;
use crate::progress::ProgressObserver;
use crate::selection;
use crate::track::read_tracks;
use artifact::Artifact;
use std::path::{Path, PathBuf};

/// Options of `trainer packed` for an artifact that has a network.
#[derive(Clone, Debug)]
pub struct PackedOptions {
    /// Folder of the artifact that the packed model joins.
    pub artifact: PathBuf,
    /// Recordings to train on and to test with, and settings of the fit.
    pub fit: FitOptions,
    /// True to replace a packed model.
    pub force: bool,
}

/// Trains a packed model, adds it to an artifact and returns its figures.
///
/// # Errors
/// If recordings cannot be used, the wanted error cannot be reached or files cannot be written.
pub fn train(
    options: &PackedOptions,
    observer: &mut impl ProgressObserver,
) -> Result<PackedTrained, TrainerError> {
    let artifact = Artifact::read(&options.artifact)?;
    if artifact.packed.is_some() && !options.force {
        return Err(TrainerError::PackedExists {
            folder: options.artifact.clone(),
        });
    }
    let description = &artifact.description;
    let count = fit::coefficients(options.fit.coefficients, description)?;
    let selected = Selected::find(&options.fit)?;
    check_writable(&options.artifact)?;
    let tracks = selected.read(description, options.fit.mains_hz, observer)?;
    let target_mse = options.fit.target_mse;
    let (mut model, trained) = fit::fit(&tracks, description, count, target_mse, observer)?;
    let card = &mut model.description.training;
    [card.train_files, card.test_files] = selected.names();
    let id = artifact
        .with_packed(Some(model))?
        .write(&options.artifact)?;
    observer.message(&format!(
        "model {id} written to {}",
        options.artifact.display()
    ));
    Ok(trained)
}

/// Measures the packed model in `folder` on recordings at every rate, finest first. `names` selects them in `data` or
/// by path.
///
/// # Errors
/// If the artifact or a recording cannot be used, or the artifact has no packed model.
pub fn compare(
    folder: &Path,
    data: &Path,
    names: &[String],
    mains_hz: u32,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<RateFigures>, TrainerError> {
    let artifact = Artifact::read(folder)?;
    let description = &artifact.description;
    let model = artifact.packed.as_ref().ok_or(TrainerError::NotPacked {
        folder: folder.to_owned(),
    })?;
    let files = selection::recordings(data, names)?;
    let tracks = read_tracks(&files, description, mains_hz, observer)?;
    evaluation::evaluate(model, &tracks, description)
}
