//! Imports a network that was trained elsewhere: its weights, and a specification of its other
//! properties.

mod agreement;
mod spec;
mod tensors;

use crate::calibrate::calibrated_artifact;
use crate::dataset::Dataset;
use crate::error::TrainerError;
use crate::evaluate::{Evaluation, Table, evaluate};
use crate::golden::golden_windows;
use crate::output::refuse_model;
use crate::parameters::Parameters;
use agreement::check_reference;
use artifact::{Artifact, Description, Geometry, ModelId, Tensors};
use sha2::{Digest, Sha256};
use spec::Spec;
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};
use tensors::{Calibration, StateDict};

pub use agreement::Agreement;

/// Options of `trainer import`.
#[derive(clap::Args, Clone, Debug)]
pub struct Import {
    /// The network's state_dict, and windows to calibrate and to compare with.
    #[arg(long = "safetensors", value_name = "FILE")]
    tensors: PathBuf,
    /// Mode, montage, scale and names, which the tensors do not contain.
    #[arg(long, value_name = "FILE")]
    spec: PathBuf,
    /// Folder to write the model to.
    #[arg(long)]
    pub out: PathBuf,
    /// Replace a model in the folder.
    #[arg(long)]
    force: bool,
}

/// An imported model.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Its id.
    pub id: ModelId,
    /// Differences from the exported network; `None` if the file has no reference.
    pub agreement: Option<Agreement>,
    /// Error of float and integer codes on the windows of the calibration; `None` if the file has
    /// ranges only.
    pub evaluation: Option<Evaluation>,
    /// Number of channels that never vary, and are held at the bias of their norm.
    pub silent_channels: usize,
}

impl Import {
    /// Checks the files, calibrates the model and writes its artifact. Writes nothing unless all
    /// checks pass.
    ///
    /// # Errors
    /// If a file cannot be read or written, the tensors are not those of the specification, the
    /// reference disagrees, or the model cannot be turned into integers.
    pub fn run(&self) -> Result<Imported, TrainerError> {
        refuse_model(&self.out, self.force)?;
        let spec = Spec::read(&self.spec)?;
        let description = spec.description(&self.spec)?;
        let collected = StateDict::read(&self.tensors)?.collect(&spec, &description);
        let collected = collected.map_err(|mistakes| {
            TrainerError::ImportMistakes(self.tensors.clone(), self.spec.clone(), mistakes)
        })?;
        let unusable = |source| TrainerError::Unusable(self.tensors.clone(), Box::new(source));
        let (mut model, silent_channels, dataset) =
            calibrated(description, &collected.weights, collected.calibration).map_err(unusable)?;
        let agreement = collected.reference.as_ref();
        let agreement = agreement.map(|reference| check_reference(&model, reference));
        let agreement = agreement.transpose()?;
        model.description.training.note = note(&self.tensors, agreement.as_ref())?;
        let integers = model_gen::quantise(&model).map_err(|source| unusable(source.into()))?;
        let evaluation = dataset.map(|dataset| evaluate(&model, &dataset));
        let evaluation = evaluation.transpose().map_err(unusable)?;
        let id = model.write(&self.out)?;
        golden_windows(&integers).write(&self.out)?;
        Ok(Imported {
            id,
            agreement,
            evaluation,
            silent_channels,
        })
    }
}

/// Returns the calibrated model, its number of silent channels, and the windows of its calibration.
fn calibrated(
    description: Description,
    weights: &Tensors,
    calibration: Calibration,
) -> Result<(Artifact, usize, Option<Dataset>), TrainerError> {
    let geometry = Geometry::new(&description);
    let mut parameters = Parameters::from_tensors(description.mode, geometry, weights)?;
    let silent_channels = parameters.hold_silent_channels();
    let (model, dataset) = match calibration {
        Calibration::Ranges(ranges) => {
            let model = Artifact::new(description, parameters.to_tensors(), ranges)?;
            (model, None)
        }
        Calibration::Windows(windows) => {
            let dataset = Dataset::from_segments(windows, description.dimensions());
            let model = calibrated_artifact(description, &parameters, &dataset)?;
            (model, Some(dataset))
        }
    };
    Ok((model, silent_channels, dataset))
}

/// Returns the note of the training card: which file was imported, and how it was checked.
fn note(tensors: &Path, agreement: Option<&Agreement>) -> Result<String, TrainerError> {
    let bytes = std::fs::read(tensors).map_err(TrainerError::file(tensors))?;
    let mut sum = String::new();
    for byte in Sha256::digest(&bytes) {
        // Writing to a String cannot fail.
        let _ = write!(sum, "{byte:02x}");
    }
    let name = tensors.file_name().unwrap_or_default().to_string_lossy();
    let checked = match agreement {
        Some(agreement) => agreement.to_string(),
        None => "Not compared with the exported network.".to_owned(),
    };
    Ok(format!("Imported from {name}, SHA-256 {sum}. {checked}"))
}

impl fmt::Display for Imported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.agreement {
            Some(agreement) => writeln!(f, "{agreement}")?,
            None => writeln!(
                f,
                "warning: the file has no reference.windows and reference.codes, so nothing shows that this network \
                 computes what the exported one does"
            )?,
        }
        if self.silent_channels > 0 {
            writeln!(
                f,
                "warning: {} channels of the convolutions never vary in the training data; they are held constant",
                self.silent_channels
            )?;
        }
        if let Some(evaluation) = self.evaluation {
            writeln!(
                f,
                "on the {} windows of the calibration:",
                evaluation.windows
            )?;
            write!(f, "{}", Table(&[("imported", evaluation)]))?;
        }
        Ok(())
    }
}
