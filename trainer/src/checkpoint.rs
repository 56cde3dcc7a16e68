//! Saves a training run between two epochs, and restores it.

use crate::adam::{Adam, Moments};
use crate::error::TrainerError;
use crate::parameters::{Parameters, is_statistic};
use crate::training::{Candidate, Settings, Training};
use artifact::{Description, Geometry, Tensors, weight_shapes};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::path::Path;
use std::str::FromStr;

/// Writes a training run to `path`; a crash while writing leaves the previous checkpoint intact.
///
/// `data` identifies the data and the model's shape: a training run can be resumed only with the same.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, training: &Training, data: &str) -> Result<(), TrainerError> {
    let bytes = to_bytes(training, data).map_err(|error| damaged(path, &error))?;
    let file_error = |source| TrainerError::File {
        path: path.to_owned(),
        source,
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(file_error)?;
    }
    let partial = path.with_extension("partial");
    std::fs::write(&partial, bytes).map_err(file_error)?;
    std::fs::rename(&partial, path).map_err(file_error)
}

/// Reads a training run that [`write()`] has written with the same settings and data. If it is finished and
/// `settings` has more epochs, they are added with a learning rate that begins another cycle.
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
    let bytes = std::fs::read(path).map_err(|source| TrainerError::File {
        path: path.to_owned(),
        source,
    })?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| damaged(path, &error))?;
    let metadata = Metadata {
        path,
        entries: header.metadata().clone().unwrap_or_default(),
    };
    let expected = training_identity(settings, data);
    let found = metadata.text("training")?;
    if found != expected {
        return Err(TrainerError::OtherTraining {
            path: path.to_owned(),
            found,
            expected,
        });
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
            wanted: settings.epochs,
        });
    }
    let file = SafeTensors::deserialize(&bytes).map_err(|error| damaged(path, &error))?;
    let tensor = |kind: &str, name: &str, shape: &[usize]| -> Result<Vec<f32>, TrainerError> {
        let name = format!("{kind}.{name}");
        let view = file.tensor(&name).map_err(|error| damaged(path, &error))?;
        if view.dtype() != Dtype::F32 || view.shape() != [shape.iter().product::<usize>()] {
            return Err(damaged(path, &format!("tensor {name} has the wrong shape")));
        }
        let (words, _) = view.data().as_chunks();
        Ok(words.iter().map(|word| f32::from_le_bytes(*word)).collect())
    };
    let parameters = |kind: &str| -> Result<Parameters, TrainerError> {
        let mut tensors = Tensors::for_weights();
        for (name, shape) in weight_shapes(mode, &geometry) {
            tensors.insert(name, &shape, tensor(kind, name, &shape)?);
        }
        Ok(Parameters::from_tensors(mode, geometry, &tensors)?)
    };
    let mut moments = BTreeMap::new();
    for (name, shape) in weight_shapes(mode, &geometry) {
        if !is_statistic(name) {
            let mean = tensor("mean", name, &shape)?;
            moments.insert(
                name,
                Moments {
                    mean,
                    square: tensor("square", name, &shape)?,
                },
            );
        }
    }
    let mut training = Training {
        settings: stored,
        epoch,
        cycle_start: metadata.number("cycle_start")?,
        parameters: parameters("current")?,
        adam: Adam {
            updates: metadata.number("updates")?,
            moments,
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

/// Returns settings and data as text, without the number of epochs. A training run can be resumed only if this text
/// is the same.
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
    let mut put = |kind: &str, name: &str, values: &[f32]| {
        let bytes = values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        tensors.insert(format!("{kind}.{name}"), bytes);
    };
    for (name, values) in training.parameters.iter() {
        put("current", name, values);
    }
    for (name, values) in training.best.parameters.iter() {
        put("best", name, values);
    }
    for (name, moments) in &training.adam.moments {
        put("mean", name, &moments.mean);
        put("square", name, &moments.square);
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
    TrainerError::Checkpoint {
        path: path.to_owned(),
        problem: problem.to_string(),
    }
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
    use crate::dataset::Split;
    use crate::network::Network;
    use crate::testing;
    use std::ops::ControlFlow;

    const SETTINGS: Settings = Settings {
        epochs: 2,
        batch: 8,
        peak_rate: 1e-3,
        seed: 4,
    };

    #[test]
    fn a_resumed_training_equals_an_uninterrupted_one() {
        let network = Network::new(&testing::description());
        let split = Split {
            training: testing::dataset(1, 16 * 16),
            validation: testing::dataset(2, 16 * 4),
        };
        let parameters =
            Parameters::from_directions(testing::geometry(), &testing::directions(), SETTINGS.seed);
        let mut through = Training::start(SETTINGS, parameters, &network, &split);
        through
            .run_epoch(&network, &split, |_, _| ControlFlow::Continue(()))
            .unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/checkpoint.safetensors");
        write(&path, &through, "these").unwrap();
        let mut resumed = read(&path, &testing::description(), SETTINGS, "these").unwrap();
        assert_eq!(resumed, through);
        through
            .run_epoch(&network, &split, |_, _| ControlFlow::Continue(()))
            .unwrap();
        resumed
            .run_epoch(&network, &split, |_, _| ControlFlow::Continue(()))
            .unwrap();
        assert_eq!(resumed, through);

        let error = read(&path, &testing::description(), SETTINGS, "others").unwrap_err();
        assert!(
            matches!(error, TrainerError::OtherTraining { .. }),
            "{error}"
        );
        let other = Settings {
            seed: 5,
            ..SETTINGS
        };
        assert!(matches!(
            read(&path, &testing::description(), other, "these"),
            Err(TrainerError::OtherTraining { .. })
        ));
        std::fs::write(&path, b"nothing").unwrap();
        assert!(matches!(
            read(&path, &testing::description(), SETTINGS, "these"),
            Err(TrainerError::Checkpoint { .. })
        ));
    }

    #[test]
    fn a_finished_training_can_go_on_with_another_cycle_and_an_unfinished_one_cannot_change() {
        let network = Network::new(&testing::description());
        let split = Split {
            training: testing::dataset(1, 16 * 16),
            validation: testing::dataset(2, 16 * 4),
        };
        let start = Parameters::from_directions(testing::geometry(), &testing::directions(), 4);
        let mut training = Training::start(SETTINGS, start, &network, &split);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.safetensors");
        let run = |training: &mut Training| {
            let go_on = |_, _| ControlFlow::Continue(());
            training.run_epoch(&network, &split, go_on).unwrap()
        };
        let read_with = |epochs| {
            let settings = Settings { epochs, ..SETTINGS };
            read(&path, &testing::description(), settings, "these")
        };
        run(&mut training);
        write(&path, &training, "these").unwrap();
        let error = read_with(5).unwrap_err().to_string();
        assert!(error.contains("1 of 2 epochs"), "{error}");
        run(&mut training);
        write(&path, &training, "these").unwrap();
        assert!(read_with(1).is_err());
        let mut longer = read_with(5).unwrap();
        assert!(!longer.is_done());
        let before = longer.parameters.clone();
        run(&mut longer);
        assert_ne!(longer.parameters, before);
        // The first rate of the cycle is far above the last of the one before, so the parameters move further than
        // they would have.
        assert_eq!(
            (longer.epoch(), longer.epochs(), longer.cycle_start),
            (3, 5, 2)
        );
    }
}
