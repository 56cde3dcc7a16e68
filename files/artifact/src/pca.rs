//! PCA of the training windows: the baseline with which a model's error is compared.

use crate::description::{Description, Mode};
use crate::error::ArtifactError;
use crate::folder::Artifact;
use crate::shapes::{INPUT_RANGE, calibration_shapes};
use crate::tensors::{PCA, Tensors};
use std::path::Path;

/// Principal directions of a model's training windows, and the calibrated ranges of their
/// components.
///
/// The file `pca.safetensors` is optional; an imported model has none.
#[derive(Clone, Debug, PartialEq)]
pub struct Pca(Tensors);

impl Pca {
    /// Creates the PCA of windows with these principal directions. `ranges` holds the smallest and
    /// the largest value of each component, and `largest_uv` is the largest magnitude of the input,
    /// microvolts.
    ///
    /// # Panics
    /// If the number of values in a range is not the number of directions.
    pub fn new(directions: &[Vec<f32>], ranges: [Vec<f32>; 2], largest_uv: f32) -> Self {
        let numbers = directions.len();
        let values = directions.concat();
        let mut tensors = Tensors::for_pca();
        tensors.insert("directions", &[numbers, values.len() / numbers.max(1)], values);
        tensors.insert(INPUT_RANGE, &[1], vec![largest_uv]);
        for (name, values) in ["code.min", "code.max"].into_iter().zip(ranges) {
            tensors.insert(name, &[numbers], values);
        }
        Self(tensors)
    }

    /// Returns the PCA that a model of mode `pca` contains.
    ///
    /// # Errors
    /// If the model has another mode.
    pub fn from_model(model: &Artifact) -> Result<Self, ArtifactError> {
        let dimensions = model.description.dimensions();
        let (numbers, window) = (dimensions.numbers, dimensions.window_electrodes());
        let directions = model.weights.tensor(DIRECTIONS_OF_MODEL, &[numbers, window])?;
        let mut tensors = Tensors::for_pca();
        tensors.insert("directions", &[numbers, window], directions.to_vec());
        for (name, shape) in calibration_shapes(Mode::Pca, &dimensions) {
            let values = model.calibration.tensor(name, &shape)?;
            tensors.insert(name, &shape, values.to_vec());
        }
        Ok(Self(tensors))
    }

    /// Returns a model of mode `pca` with these directions and the other settings of `description`.
    ///
    /// # Errors
    /// If the directions or ranges do not fit the description.
    pub fn to_model(&self, mut description: Description) -> Result<Artifact, ArtifactError> {
        description.mode = Mode::Pca;
        let dimensions = description.dimensions();
        let (numbers, window) = (dimensions.numbers, dimensions.window_electrodes());
        let directions = self.0.tensor("directions", &[numbers, window])?;
        let transposed =
            (0..window).flat_map(|value| directions.iter().skip(value).step_by(window)).copied();
        let mut weights = Tensors::for_weights();
        weights.insert("decoder.shortcut.weight", &[window, numbers], transposed.collect());
        weights.insert(DIRECTIONS_OF_MODEL, &[numbers, window], directions.to_vec());
        let mut calibration = Tensors::for_calibration();
        for (name, shape) in calibration_shapes(Mode::Pca, &dimensions) {
            let values = self.0.tensor(name, &shape)?;
            calibration.insert(name, &shape, values.to_vec());
        }
        Artifact::new(description, weights, calibration)
    }

    /// Reads `pca.safetensors` from an artifact's folder; `None` if the folder has no such file.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn read(folder: &Path) -> Result<Option<Self>, ArtifactError> {
        let path = folder.join(PCA);
        match std::fs::read(&path) {
            Ok(bytes) => Ok(Some(Self(Tensors::from_bytes(PCA, &bytes)?))),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(ArtifactError::file(&path)(error)),
        }
    }

    /// Writes `pca.safetensors` into the folder of an artifact.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), ArtifactError> {
        let path = folder.join(PCA);
        let bytes = self.0.to_bytes()?;
        std::fs::write(&path, bytes).map_err(ArtifactError::file(&path))
    }
}

/// Name of the tensor with the directions in a model of mode `pca`.
const DIRECTIONS_OF_MODEL: &str = "encoder.shortcut.weight";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn a_pca_model_is_the_same_after_the_file() {
        let model = testing::pca();
        let folder = tempfile::tempdir().unwrap();
        assert!(Pca::read(folder.path()).unwrap().is_none());
        let pca = Pca::from_model(&model).unwrap();
        pca.write(folder.path()).unwrap();
        let read = Pca::read(folder.path()).unwrap().unwrap();
        assert_eq!(read, pca);
        assert_eq!(read.to_model(model.description.clone()).unwrap(), model);
    }

    #[test]
    fn a_file_of_another_model_is_refused_by_name_and_shape() {
        let model = testing::pca();
        let pca = Pca::from_model(&model).unwrap();
        let mut description = model.description.clone();
        description.code.numbers = 64;
        let error = pca.to_model(description).unwrap_err().to_string();
        assert!(error.contains("pca.safetensors") && error.contains("directions"), "{error}");
    }
}
