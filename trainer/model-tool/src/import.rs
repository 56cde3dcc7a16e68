//! Import of a network that was trained elsewhere: its weights, and a specification of what they do not say.

mod agreement;
mod collect;
mod mistake;
mod spec;
mod state_dict;

use crate::error::ToolError;
use agreement::check_reference;
use artifact::{Artifact, ModelId};
use collect::{Calibration, Collected, collect};
use sha2::{Digest, Sha256};
use spec::Spec;
use state_dict::StateDict;
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};
use trainer::calibrate::calibrated_artifact;
use trainer::dataset::Dataset;
use trainer::error::TrainerError;
use trainer::evaluate::{Evaluation, Table, evaluate};
use trainer::golden::golden_windows;
use trainer::parameters::Parameters;

pub use agreement::Agreement;

/// What to import, and where to.
#[derive(Clone, Debug)]
pub struct Import {
    /// The exported tensors, a safetensors file.
    pub tensors: PathBuf,
    /// The specification, a TOML file.
    pub spec: PathBuf,
    /// Folder of the new artifact.
    pub out: PathBuf,
    /// Whether to replace a model in `out`.
    pub force: bool,
}

/// An imported model.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Its id.
    pub id: ModelId,
    /// How far it agrees with the exported network; `None` if the file has no reference.
    pub agreement: Option<Agreement>,
    /// Error of float and integer codes on the windows of the calibration; `None` if the file has ranges only.
    pub evaluation: Option<Evaluation>,
    /// Number of channels that never vary, and are held at the bias of their norm.
    pub silent_channels: usize,
}

impl Import {
    /// Checks the files, calibrates the model and writes its artifact. Nothing is written unless all is well.
    ///
    /// # Errors
    /// If a file cannot be read or written, the tensors are not those of the specification, the reference
    /// disagrees, or the model cannot be turned into integers.
    pub fn run(&self) -> Result<Imported, ToolError> {
        if !self.force && self.out.join("model.toml").exists() {
            return Err(ToolError::Exists {
                folder: self.out.clone(),
            });
        }
        let spec = Spec::read(&self.spec)?;
        let description = spec.description(&self.spec)?;
        let file = StateDict::read(&self.tensors)?;
        let Collected {
            weights,
            calibration,
            reference,
        } = collect(&file, &spec, &description).map_err(|mistakes| ToolError::Mistakes {
            tensors: self.tensors.clone(),
            spec: self.spec.clone(),
            mistakes: mistakes.iter().map(ToString::to_string).collect(),
        })?;
        let unusable = |source: TrainerError| ToolError::Unusable {
            path: self.tensors.clone(),
            source: Box::new(source),
        };
        let geometry = artifact::Geometry::new(&description);
        let mut parameters = Parameters::from_tensors(description.mode, geometry, &weights)
            .map_err(|source| unusable(source.into()))?;
        let silent_channels = parameters.hold_silent_channels();
        let (mut model, dataset) = match calibration {
            Calibration::Ranges(ranges) => {
                let model = Artifact::new(description, parameters.to_tensors(), ranges);
                (model.map_err(|source| unusable(source.into()))?, None)
            }
            Calibration::Windows(windows) => {
                let dataset = Dataset::from_segments(windows, description.dimensions());
                let model = calibrated_artifact(description, &parameters, &dataset);
                (model.map_err(unusable)?, Some(dataset))
            }
        };
        let agreement = match &reference {
            Some(reference) => Some(check_reference(&model, reference)?),
            None => None,
        };
        model.description.training.note = note(&self.tensors, agreement.as_ref())?;
        let integers =
            model_gen::quantise(&model).map_err(|source| unusable(TrainerError::from(source)))?;
        let evaluation = match &dataset {
            Some(dataset) => Some(evaluate(&model, dataset).map_err(unusable)?),
            None => None,
        };
        let write = |source| ToolError::Write {
            folder: self.out.clone(),
            source: Box::new(source),
        };
        let id = model.write(&self.out).map_err(write)?;
        golden_windows(&integers).write(&self.out).map_err(write)?;
        Ok(Imported {
            id,
            agreement,
            evaluation,
            silent_channels,
        })
    }
}

/// Returns the note of the training card: which file was imported, and how it was checked.
fn note(tensors: &Path, agreement: Option<&Agreement>) -> Result<String, ToolError> {
    let bytes = std::fs::read(tensors).map_err(|source| ToolError::File {
        path: tensors.to_owned(),
        source,
    })?;
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
