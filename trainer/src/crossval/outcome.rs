//! The outcome of one fold, and the file that holds it.

use super::plan::Fold;
use crate::error::TrainerError;
use crate::evaluate::ReconstructionError;
use crate::training::LearningCurve;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// Name of the folder with the outcomes, within the folder of the tables.
const FOLDER: &str = "folds";

/// Errors of the models of one fold. All figures are over all electrodes and all test windows at
/// every hop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// All settings that determine the figures, as text.
    pub(super) settings: String,
    pub(crate) subject: String,
    /// Number of the repetition, from 1.
    pub(crate) repetition: usize,
    /// Number of the fold within the repetition, from 1.
    pub(crate) fold: usize,
    pub(crate) mode: String,
    /// Number of values in a code.
    pub(crate) numbers: usize,
    /// Whether the signal can be decoded from the code alone.
    pub(crate) is_decodable: bool,
    /// Recordings, or blocks of recordings, on which the model was tested, as text.
    pub(crate) tested_on: String,
    /// Number of windows on which the model was tested.
    pub(crate) windows: usize,
    /// Standard deviation of the training part, uV.
    pub(crate) sd_uv: f64,
    /// Epoch with the smallest validation error; 0 for the initial parameters.
    pub(crate) best_epoch: u32,
    pub(crate) validation: Validation,
    /// Training and validation errors of all epochs; absent in mode `pca`, which has no epochs, and
    /// in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) curve: Option<LearningCurve>,
    /// Error of the model with float codes.
    pub(crate) model_float: Option<ReconstructionError>,
    /// Error of the model with integer codes; absent if integer codes cannot be decoded.
    pub(crate) model_integer: Option<ReconstructionError>,
    /// Error of PCA with float codes.
    pub(crate) pca_float: ReconstructionError,
    /// Error of PCA with integer codes.
    pub(crate) pca_integer: ReconstructionError,
}

/// Mean squared errors on disjoint windows of the validation part, in units of the training
/// variance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Validation {
    /// Error of the model with the parameters of its best epoch.
    pub(crate) model: f64,
    pub(crate) pca: f64,
}

impl Outcome {
    /// Returns the name of the fold, as [`Fold::name`] does.
    pub(crate) fn name(&self) -> String {
        format!("{}-r{}-f{}", self.subject, self.repetition, self.fold)
    }

    /// Writes the outcome to a folder. A crash while writing leaves no incomplete outcome.
    pub(super) fn write(&self, folder: &Path) -> Result<(), TrainerError> {
        let path = folder.join(FOLDER).join(format!("{}.json", self.name()));
        let text = serde_json::to_string_pretty(self)
            .map_err(|source| TrainerError::Outcome(path.clone(), source))?;
        let partial = path.with_extension(format!("{}.part", std::process::id()));
        let written = fs::write(&partial, text + "\n").and_then(|()| fs::rename(&partial, &path));
        written.map_err(TrainerError::file(&path))
    }
}

/// Creates `folder` for the tables, and the folder of the outcomes in it.
pub(super) fn prepare(folder: &Path) -> Result<(), TrainerError> {
    let path = folder.join(FOLDER);
    fs::create_dir_all(&path).map_err(TrainerError::file(&path))
}

/// Reads the outcome of a fold from a folder; `None` if the folder does not have it yet.
pub(super) fn read(
    folder: &Path,
    fold: &Fold,
    settings: &str,
) -> Result<Option<Outcome>, TrainerError> {
    let path = folder.join(FOLDER).join(format!("{}.json", fold.name()));
    if !path.exists() {
        return Ok(None);
    }
    let text = fs::read_to_string(&path).map_err(TrainerError::file(&path))?;
    let outcome: Outcome = serde_json::from_str(&text)
        .map_err(|source| TrainerError::Outcome(path.clone(), source))?;
    if outcome.settings != settings {
        let (found, expected) = (outcome.settings, settings.to_owned());
        return Err(TrainerError::OtherCrossval(path, found, expected));
    }
    Ok(Some(outcome))
}
