//! Saves a training run between two epochs, and restores it.

use crate::adam::Adam;
use crate::error::TrainerError;
use crate::parameters::{Parameters, TENSORS, Tensor, Weights, shapes};
use crate::training::{Candidate, LearningCurve, Settings, Training};
use artifact::{Description, Geometry, Tensors};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::path::Path;

/// Writes a training run to `path`; a crash while writing leaves the previous checkpoint intact.
///
/// `data` is a text that identifies the data and the model's shape. A training run can be resumed
/// only with the same text.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(path: &Path, training: &Training, data: &str) -> Result<(), TrainerError> {
    let bytes = to_bytes(path, training, data)?;
    let file_error = TrainerError::file(path);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(file_error)?;
    }
    let partial = path.with_extension("partial");
    std::fs::write(&partial, bytes).map_err(file_error)?;
    std::fs::rename(&partial, path).map_err(file_error)
}

/// Reads a training run that [`write()`] has written with the same settings and data. If the run is
/// finished and `settings` has more epochs, the additional epochs form another cycle of the
/// learning rate.
///
/// # Errors
/// If the file cannot be read, is damaged or belongs to another training run.
pub(crate) fn read(
    path: &Path,
    description: &Description,
    settings: Settings,
    data: &str,
) -> Result<Training, TrainerError> {
    let (mode, geometry) = (description.mode, Geometry::new(description));
    let bytes = std::fs::read(path).map_err(TrainerError::file(path))?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| damaged(path, &error))?;
    let state = header.metadata().as_ref().and_then(|entries| entries.get(STATE));
    let state = state.ok_or_else(|| damaged(path, &"it has no state"))?;
    let state: State = serde_json::from_str(state).map_err(|error| damaged(path, &error))?;
    let expected = training_identity(settings, data);
    if state.training != expected {
        let path = path.to_owned();
        return Err(TrainerError::OtherTraining(path, state.training, expected));
    }
    let State { epochs, epoch, .. } = state;
    if settings.epochs < epochs || (settings.epochs > epochs && epoch < epochs) {
        return Err(TrainerError::OtherEpochs {
            path: path.to_owned(),
            stored: epochs,
            finished: epoch,
            requested: settings.epochs,
        });
    }
    let file = SafeTensors::deserialize(&bytes).map_err(|error| damaged(path, &error))?;
    let tensor = |kind: &str, tensor: &Tensor, shape: &[usize]| -> Result<Vec<f32>, TrainerError> {
        let name = format!("{kind}.{}", tensor.name);
        let view = file.tensor(&name).map_err(|error| damaged(path, &error))?;
        if view.dtype() != Dtype::F32 || view.shape() != [shape.iter().product::<usize>()] {
            return Err(damaged(path, &format!("tensor {name} has the wrong shape")));
        }
        let (words, _) = view.data().as_chunks();
        Ok(words.iter().map(|word| f32::from_le_bytes(*word)).collect())
    };
    let shapes = shapes(mode, &geometry);
    let parameters = |kind: &str| -> Result<Parameters, TrainerError> {
        let mut tensors = Tensors::for_weights();
        for (field, shape) in &shapes {
            tensors.insert(field.name, shape, tensor(kind, field, shape)?);
        }
        Ok(Parameters::from_tensors(mode, geometry, &tensors)?)
    };
    let moments = |kind: &str| -> Result<Weights, TrainerError> {
        let mut weights = Weights::default();
        for (field, shape) in shapes.iter().filter(|(tensor, _)| tensor.is_trained()) {
            *field.of_mut(&mut weights) = tensor(kind, field, shape)?;
        }
        Ok(weights)
    };
    let mut training = Training {
        settings: Settings { epochs, ..settings },
        epoch,
        cycle_start: state.cycle_start,
        parameters: parameters("current")?,
        adam: Adam { updates: state.updates, mean: moments("mean")?, square: moments("square")? },
        best: Candidate {
            epoch: state.best_epoch,
            validation: state.best_validation,
            parameters: parameters("best")?,
        },
        curve: state.curve,
    };
    if settings.epochs > epochs {
        training.extend(settings.epochs);
    }
    Ok(training)
}

/// Key of the [`State`] in the metadata of a checkpoint.
const STATE: &str = "state";

/// The state of a training run except its tensors; stored as JSON.
#[derive(Serialize, Deserialize)]
struct State {
    /// Settings and data of the checkpoint, as the text that [`training_identity`] returns.
    training: String,
    /// Number of epochs after which the training run is finished.
    epochs: u32,
    cycle_start: u32,
    /// Number of finished epochs.
    epoch: u32,
    /// Number of updates of the optimiser.
    updates: u64,
    best_epoch: u32,
    best_validation: f64,
    curve: LearningCurve,
}

/// Returns settings and data as text, without the number of epochs. A training run can be resumed
/// only if this text is the same.
fn training_identity(settings: Settings, data: &str) -> String {
    format!("{settings}, on {data}")
}

fn to_bytes(path: &Path, training: &Training, data: &str) -> Result<Vec<u8>, TrainerError> {
    let mut tensors: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for (kind, weights) in [
        ("current", &training.parameters.weights),
        ("best", &training.best.parameters.weights),
        ("mean", &training.adam.mean),
        ("square", &training.adam.square),
    ] {
        for tensor in TENSORS {
            let values = tensor.of(weights).iter();
            if values.len() > 0 {
                let bytes = values.flat_map(|value| value.to_le_bytes()).collect();
                tensors.insert(format!("{kind}.{}", tensor.name), bytes);
            }
        }
    }
    let state = State {
        training: training_identity(training.settings, data),
        epochs: training.settings.epochs,
        cycle_start: training.cycle_start,
        epoch: training.epoch,
        updates: training.adam.updates,
        best_epoch: training.best.epoch,
        best_validation: training.best.validation,
        curve: training.curve.clone(),
    };
    // A float is written with enough digits to read back with the same bits.
    let state = serde_json::to_string(&state).map_err(|error| damaged(path, &error))?;
    let metadata = HashMap::from([(STATE.to_owned(), state)]);
    let views = tensors.iter().map(|(name, bytes)| {
        let view = TensorView::new(Dtype::F32, vec![bytes.len() / 4], bytes);
        view.map(|view| (name, view))
    });
    views
        .collect::<Result<Vec<_>, _>>()
        .and_then(|views| safetensors::serialize(views, Some(metadata)))
        .map_err(|error| damaged(path, &error))
}

fn damaged(path: &Path, problem: &dyn Display) -> TrainerError {
    TrainerError::Checkpoint(path.to_owned(), problem.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{self, Run, SETTINGS};
    use std::path::PathBuf;

    fn path(folder: &tempfile::TempDir) -> PathBuf {
        folder.path().join("deep/checkpoint.safetensors")
    }

    fn read_with(path: &Path, settings: Settings, data: &str) -> Result<Training, TrainerError> {
        read(path, &testing::description(), settings, data)
    }

    #[test]
    fn a_resumed_training_equals_an_uninterrupted_one() {
        let (run, folder) = (Run::new(), tempfile::tempdir().unwrap());
        let path = path(&folder);
        let mut through = run.start();
        run.run_epoch(&mut through);
        write(&path, &through, "these").unwrap();
        let mut resumed = read_with(&path, SETTINGS, "these").unwrap();
        assert_eq!(resumed, through);
        run.run_epoch(&mut through);
        run.run_epoch(&mut resumed);
        assert_eq!(resumed, through);

        let seed = SETTINGS.seed + 1;
        for (settings, data) in [(SETTINGS, "others"), (Settings { seed, ..SETTINGS }, "these")] {
            let error = read_with(&path, settings, data).unwrap_err();
            let is_other = matches!(error, TrainerError::OtherTraining(..));
            assert!(is_other, "{error}");
        }
        std::fs::write(&path, b"nothing").unwrap();
        let error = read_with(&path, SETTINGS, "these").unwrap_err();
        assert!(matches!(error, TrainerError::Checkpoint(..)), "{error}");
    }

    #[test]
    fn a_finished_training_can_go_on_with_another_cycle_and_an_unfinished_one_cannot_change() {
        let (run, folder) = (Run::new(), tempfile::tempdir().unwrap());
        let path = path(&folder);
        let mut training = run.start();
        let read_with = |epochs| read_with(&path, Settings { epochs, ..SETTINGS }, "these");
        run.run_epoch(&mut training);
        write(&path, &training, "these").unwrap();
        let error = read_with(5).unwrap_err().to_string();
        assert!(error.contains("1 of 2 epochs"), "{error}");
        run.run_epoch(&mut training);
        write(&path, &training, "these").unwrap();
        assert!(read_with(1).is_err());
        let mut longer = read_with(5).unwrap();
        assert!(!longer.is_done());
        let before = longer.parameters.clone();
        run.run_epoch(&mut longer);
        // The first epoch of the new cycle changes the parameters, because the cycle begins with a
        // rate above 0.
        assert_ne!(longer.parameters, before);
        assert_eq!((longer.epoch, longer.settings.epochs, longer.cycle_start), (3, 5, 2));
    }
}
