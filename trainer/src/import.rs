//! Imports a network that was trained elsewhere: its weights, and a specification of its other
//! properties.

mod spec;
mod tensors;

use crate::calibrate::calibrated_artifact;
use crate::dataset::Dataset;
use crate::error::TrainerError;
use crate::evaluate::{Evaluation, Table, evaluate};
use crate::golden::golden_windows;
use crate::parameters::Parameters;
use crate::selection::refuse_model;
use artifact::{
    Artifact, Description, FloatDecoder, FloatEncoder, Geometry, ModelId, ScalpGrid, Tensors,
};
use sha2::{Digest, Sha256};
use spec::Spec;
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};
use tensors::{Calibration, Reference, StateDict};

/// Options of `trainer import`.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Import {
    /// The network's state_dict, windows to calibrate with and windows to compare with.
    #[arg(long = "safetensors", value_name = "FILE")]
    tensors: PathBuf,
    /// Mode, montage, scale and names, which the tensors do not contain.
    #[arg(long, value_name = "FILE")]
    spec: PathBuf,
    /// Folder to write the model to.
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Replace a model in the folder of --out.
    #[arg(long)]
    force: bool,
}

/// Id of the imported model, and how closely it agrees with the exported network.
#[derive(Clone, Debug)]
pub(crate) struct Imported {
    pub(crate) id: ModelId,
    /// Differences from the exported network; `None` if the file has no reference.
    pub(crate) agreement: Option<Agreement>,
    /// Error of float and integer codes on the calibration windows; `None` if the file contains
    /// ranges instead of windows.
    pub(crate) evaluation: Option<Evaluation>,
    /// Number of channels that never vary, and are therefore held at the bias of their batch norm.
    pub(crate) silent_channels: usize,
}

impl Import {
    /// Checks the files, calibrates the model and writes its artifact. Writes nothing unless all
    /// checks pass.
    ///
    /// # Errors
    /// If a file cannot be read or written, the tensors do not fit the specification, the model
    /// yields other values than the reference, or the model cannot be turned into integers.
    pub(crate) fn run(&self) -> Result<Imported, TrainerError> {
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
        Ok(Imported { id, agreement, evaluation, silent_channels })
    }
}

/// Returns the calibrated model, its number of silent channels, and its calibration windows.
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

/// Returns the note for the training card: which file was imported, and how it was checked.
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
            writeln!(f, "on the {} windows of the calibration:", evaluation.windows)?;
            write!(f, "{}", Table(&[("imported", evaluation)]))?;
        }
        Ok(())
    }
}

/// Largest accepted difference, relative to the RMS of the reference. Float sums in another order
/// differ by about 1e-6, on GPUs with TF32 by up to 1e-3; layers in another order differ by more
/// than 1e-1.
const TOLERANCE: f32 = 2e-3;

/// Largest differences between the outputs of a model and the outputs of the exported network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Agreement {
    pub(crate) windows: usize,
    /// Largest difference between a code value and its reference, relative to the RMS of all
    /// reference codes.
    pub(crate) codes: f32,
    /// Largest difference between a reconstructed value and its reference, relative to the RMS of
    /// all reference reconstructions; `None` if the file has no reconstructions.
    pub(crate) reconstructions: Option<f32>,
}

/// Runs the float network on the windows of the reference, and compares its codes and
/// reconstructions with the outputs of the exported network.
///
/// # Errors
/// If a difference exceeds the tolerance.
fn check_reference(model: &Artifact, reference: &Reference) -> Result<Agreement, TrainerError> {
    let encoder = FloatEncoder::new(model)?;
    let windows = reference.windows.iter();
    let codes: Vec<Vec<f32>> = windows.map(|window| encoder.encode(window)).collect();
    let code_difference = largest_difference("code", &codes, &reference.codes)?;
    let reconstructions = match &reference.reconstructions {
        None => None,
        Some(expected) => {
            let decoder = FloatDecoder::new(model)?;
            let grid = ScalpGrid::new(&model.description);
            let expected = expected.iter().map(|window| grid.gather(window));
            let expected: Vec<Vec<f32>> = expected.collect();
            let found: Vec<Vec<f32>> = codes.iter().map(|code| decoder.decode(code)).collect();
            Some(largest_difference("reconstruction", &found, &expected)?)
        }
    };
    Ok(Agreement { windows: codes.len(), codes: code_difference, reconstructions })
}

/// Returns the largest difference between a found and an expected value, relative to the RMS of all
/// expected values.
fn largest_difference(
    what: &'static str,
    found: &[Vec<f32>],
    expected: &[Vec<f32>],
) -> Result<f32, TrainerError> {
    let values = || expected.iter().flatten();
    let squares: f32 = values().map(|value| value * value).sum();
    let rms = (squares / values().count().max(1) as f32).sqrt();
    let mut largest = (0.0_f32, 0, 0);
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        for (element, (found, expected)) in found.iter().zip(expected).enumerate() {
            let difference = (found - expected).abs();
            // A difference that is NaN counts as the largest.
            if difference.is_nan() || difference > largest.0 {
                largest = (difference, index, element);
            }
        }
    }
    let (difference, index, element) = largest;
    if difference.is_nan() || difference > TOLERANCE * rms {
        return Err(TrainerError::Reference {
            what,
            index,
            element,
            difference,
            rms,
            tolerance: TOLERANCE,
        });
    }
    Ok(if rms > 0.0 { difference / rms } else { 0.0 })
}

impl fmt::Display for Agreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "The codes of {} windows equal the exported network's within {:.0e} of their RMS",
            self.windows, self.codes
        )?;
        match self.reconstructions {
            Some(difference) => write!(f, ", their reconstructions within {difference:.0e}."),
            None => write!(f, "."),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn difference(found: &[f32]) -> Result<f32, TrainerError> {
        let expected = [vec![3.0, 4.0], vec![4.0, -3.0]];
        let found: Vec<Vec<f32>> = found.chunks_exact(2).map(<[f32]>::to_vec).collect();
        largest_difference("code", &found, &expected)
    }

    #[test]
    fn differences_are_relative_to_the_rms_and_refused_if_too_large_or_not_finite() {
        let largest = difference(&[3.0, 4.001, 4.0, -3.002]).expect("within the tolerance");
        // The RMS of all expected values is sqrt(12.5), about 3.535534.
        assert!((largest - 0.002 / 3.535_534).abs() < 1e-6, "{largest}");
        for wrong in [f32::NAN, f32::INFINITY, -3.1] {
            let error = difference(&[3.0, 4.0, 4.0, wrong]).expect_err("a wrong value");
            let TrainerError::Reference { index, element, .. } = error else {
                panic!("{error}");
            };
            assert_eq!((index, element), (1, 1));
        }
    }
}
