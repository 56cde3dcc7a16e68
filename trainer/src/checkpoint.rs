//! Saves a training run between two epochs, and restores it.

use crate::adam::Adam;
use crate::error::TrainerError;
use crate::parameters::{Parameters, TENSORS, Tensor, Weights, shapes};
use crate::training::{Candidate, Settings, Training};
use artifact::{Description, Geometry, Tensors};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::path::Path;
use std::str::FromStr;

/// Writes a training run to `path`; a crash while writing leaves the previous checkpoint intact.
///
/// `data` identifies the data and the model's shape: a training run can be resumed only with the
/// same.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, training: &Training, data: &str) -> Result<(), TrainerError> {
    let bytes = to_bytes(training, data).map_err(|error| damaged(path, &error))?;
    let file_error = TrainerError::file(path);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(file_error)?;
    }
    let partial = path.with_extension("partial");
    std::fs::write(&partial, bytes).map_err(file_error)?;
    std::fs::rename(&partial, path).map_err(file_error)
}

/// Reads a training run that [`write()`] has written with the same settings and data. If it is
/// finished and `settings` has more epochs, they are added with a learning rate that begins another
/// cycle.
///
/// # Errors
/// If the file cannot be read, is damaged or belongs to another training run.
pub fn read(
    path: &Path,
    description: &Description,
    settings: Settings,
    data: &str,
) -> Result<Training, TrainerError> {
    let (mode, geometry) = (description.mode, Geometry::new(description));
    let bytes = std::fs::read(path).map_err(TrainerError::file(path))?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| damaged(path, &error))?;
    let metadata = Metadata {
        path,
        entries: header.metadata().clone().unwrap_or_default(),
    };
    let expected = training_identity(settings, data);
    let found = metadata.text("training")?;
    if found != expected {
        let path = path.to_owned();
        return Err(TrainerError::OtherTraining(path, found, expected));
    }
    let stored = Settings {
        epochs: metadata.number("epochs")?,
        ..settings
    };
    let epoch: u32 = metadata.number("epoch")?;
    if settings.epochs < stored.epochs || (settings.epochs > stored.epochs && epoch < stored.epochs)
    {
        return Err(TrainerError::OtherEpochs {
            path: path.to_owned(),
            stored: stored.epochs,
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
        settings: stored,
        epoch,
        cycle_start: metadata.number("cycle_start")?,
        parameters: parameters("current")?,
        adam: Adam {
            updates: metadata.number("updates")?,
            mean: moments("mean")?,
            square: moments("square")?,
        },
        best: Candidate {
            epoch: metadata.number("best_epoch")?,
            validation: metadata.number("best_validation")?,
            parameters: parameters("best")?,
        },
        curve: metadata.number("curve")?,
    };
    if settings.epochs > stored.epochs {
        training.extend(settings.epochs);
    }
    Ok(training)
}

/// Returns settings and data as text, without the number of epochs. A training run can be resumed
/// only if this text is the same.
fn training_identity(settings: Settings, data: &str) -> String {
    let Settings {
        epochs: _,
        batch,
        peak_rate,
        seed,
    } = settings;
    format!("batches of {batch} at a learning rate of {peak_rate} with seed {seed}, on {data}")
}

fn to_bytes(training: &Training, data: &str) -> Result<Vec<u8>, safetensors::SafeTensorError> {
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
    let mut views = Vec::with_capacity(tensors.len());
    for (name, bytes) in &tensors {
        views.push((
            name,
            TensorView::new(Dtype::F32, vec![bytes.len() / 4], bytes)?,
        ));
    }
    // A float is written with enough digits to parse to the same bits.
    let entries = HashMap::from([
        ("training", training_identity(training.settings, data)),
        ("epochs", training.settings.epochs.to_string()),
        ("cycle_start", training.cycle_start.to_string()),
        ("epoch", training.epoch.to_string()),
        ("updates", training.adam.updates.to_string()),
        ("best_epoch", training.best.epoch.to_string()),
        ("best_validation", training.best.validation.to_string()),
        ("curve", training.curve.to_string()),
    ]);
    let entries = entries
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
    safetensors::serialize(views, Some(entries))
}

fn damaged(path: &Path, problem: &dyn Display) -> TrainerError {
    TrainerError::Checkpoint(path.to_owned(), problem.to_string())
}

/// Metadata in the header of a checkpoint.
struct Metadata<'a> {
    path: &'a Path,
    entries: HashMap<String, String>,
}

impl Metadata<'_> {
    fn text(&self, name: &str) -> Result<String, TrainerError> {
        let value = self.entries.get(name);
        value
            .cloned()
            .ok_or_else(|| damaged(self.path, &format!("its {name} is missing")))
    }

    fn number<T: FromStr>(&self, name: &str) -> Result<T, TrainerError> {
        let text = self.text(name)?;
        text.parse()
            .map_err(|_| damaged(self.path, &format!("its {name} is {text}")))
    }
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
        for (settings, data) in [
            (SETTINGS, "others"),
            (Settings { seed, ..SETTINGS }, "these"),
        ] {
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
        // The first rate of the new cycle is not 0.
        assert_ne!(longer.parameters, before);
        assert_eq!(
            (longer.epoch(), longer.epochs(), longer.cycle_start),
            (3, 5, 2)
        );
    }
}
