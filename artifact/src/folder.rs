//! A trained model, and the folder it is stored in.

use crate::description::Description;
use crate::error::ArtifactError;
use crate::model_id::ModelId;
use crate::packed::{PACKED_DESCRIPTION, PACKED_TENSORS, PackedFiles, PackedModel};
use crate::tensors::{CALIBRATION, Tensors, WEIGHTS};
use crate::validation;
use std::path::Path;

/// Name of the file that holds the description.
const DESCRIPTION: &str = "model.toml";

/// Factor by which the range of the quantised input and activations exceeds the range in calibration.
/// Clipping costs far more accuracy than a coarser resolution.
pub const HEAD_ROOM: f64 = 1.25;

/// A trained model: description, weights and calibration that belong together.
///
/// Every constructor validates the parts: all tensors of the mode have the right shapes, all numbers
/// are finite, and the montage fits the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Artifact {
    /// Everything that training decided except the weights.
    pub description: Description,
    /// Weights of encoder and decoder, f32.
    pub weights: Tensors,
    /// Calibrated ranges, f32, from which model-gen derives the int8 scales.
    pub calibration: Tensors,
    /// Predictive transform code of the same montage and hop, if the model has one.
    pub packed: Option<PackedModel>,
    /// Hash over the files of all these parts; identifies the model.
    pub id: ModelId,
}

/// Contents of the files that the model id covers.
struct FileBytes {
    description: String,
    weights: Vec<u8>,
    calibration: Vec<u8>,
    packed: Option<PackedFiles>,
}

impl FileBytes {
    /// Returns names and contents in the order in which the model id hashes them.
    fn named(&self) -> Vec<(&str, &[u8])> {
        let mut files: Vec<(&str, &[u8])> = vec![
            (DESCRIPTION, self.description.as_bytes()),
            (WEIGHTS, &self.weights),
            (CALIBRATION, &self.calibration),
        ];
        if let Some(packed) = &self.packed {
            files.push((PACKED_DESCRIPTION, packed.description.as_bytes()));
            files.push((PACKED_TENSORS, &packed.tensors));
        }
        files
    }
}

impl Artifact {
    /// Creates a model from its parts. Its id is that of the files that [`Artifact::write`] writes.
    ///
    /// # Errors
    /// If the parts are not a valid model.
    pub fn new(
        description: Description,
        weights: Tensors,
        calibration: Tensors,
    ) -> Result<Self, ArtifactError> {
        let mut artifact = Self {
            description,
            weights,
            calibration,
            packed: None,
            id: ModelId([0; 8]),
        };
        artifact.check()?;
        artifact.id = ModelId::from_files(&artifact.to_bytes()?.named());
        Ok(artifact)
    }

    /// Returns the model with this packed model, or without one. Its id is that of the files that
    /// [`Artifact::write`] writes.
    ///
    /// # Errors
    /// If the packed model does not fit the montage and the hop.
    pub fn with_packed(mut self, packed: Option<PackedModel>) -> Result<Self, ArtifactError> {
        self.packed = packed;
        self.check()?;
        self.id = ModelId::from_files(&self.to_bytes()?.named());
        Ok(self)
    }

    /// Reads a model from its folder.
    ///
    /// # Errors
    /// If a file cannot be read or the files are not a valid model.
    pub fn read(folder: &Path) -> Result<Self, ArtifactError> {
        let read = |name: &str| {
            let path = folder.join(name);
            std::fs::read(&path).map_err(|source| ArtifactError::File { path, source })
        };
        let path = folder.join(DESCRIPTION);
        let description = std::fs::read_to_string(&path)
            .map_err(|source| ArtifactError::File { path, source })?;
        let packed = PackedFiles::read(folder)?;
        let packed = packed.as_ref();
        Self::from_bytes(
            &description,
            &read(WEIGHTS)?,
            &read(CALIBRATION)?,
            packed.map(|files| (files.description.as_str(), files.tensors.as_slice())),
        )
    }

    /// Parses a model from the contents of its files, for programs that embed them. `packed` is the text of
    /// `packed.toml` and the bytes of `packed.safetensors`.
    ///
    /// # Errors
    /// If the contents are not a valid model.
    pub fn from_bytes(
        model_toml: &str,
        weights: &[u8],
        calibration: &[u8],
        packed: Option<(&str, &[u8])>,
    ) -> Result<Self, ArtifactError> {
        let mut files = vec![
            (DESCRIPTION, model_toml.as_bytes()),
            (WEIGHTS, weights),
            (CALIBRATION, calibration),
        ];
        if let Some((toml, tensors)) = packed {
            files.push((PACKED_DESCRIPTION, toml.as_bytes()));
            files.push((PACKED_TENSORS, tensors));
        }
        let description: Description = toml::from_str(model_toml)?;
        validation::check_description(&description)?;
        let artifact = Self {
            weights: Tensors::from_bytes(WEIGHTS, weights)?,
            calibration: Tensors::from_bytes(CALIBRATION, calibration)?,
            packed: packed
                .map(|(toml, tensors)| PackedModel::parse(toml, tensors, &description))
                .transpose()?,
            id: ModelId::from_files(&files),
            description,
        };
        artifact.check()?;
        Ok(artifact)
    }

    /// Writes the files that the model id covers into a folder, creates it if necessary, and
    /// returns the id of the written files. This id equals `self.id`, unless a part was changed after
    /// the model was created, or the model was read from a hand-written `model.toml`.
    ///
    /// # Errors
    /// If the parts are not a valid model or a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<ModelId, ArtifactError> {
        self.check()?;
        let bytes = self.to_bytes()?;
        let error = |path: &Path, source| ArtifactError::File {
            path: path.to_owned(),
            source,
        };
        std::fs::create_dir_all(folder).map_err(|source| error(folder, source))?;
        for (name, content) in bytes.named() {
            let path = folder.join(name);
            std::fs::write(&path, content).map_err(|source| error(&path, source))?;
        }
        if self.packed.is_none() {
            PackedFiles::remove(folder)?;
        }
        Ok(ModelId::from_files(&bytes.named()))
    }

    /// Returns the microvolts of one level of the encoder's int8 input; the input's zero point is 0.
    ///
    /// # Errors
    /// If the calibration has no `input.max_abs`; impossible after [`Artifact::read`].
    pub fn input_scale_uv(&self) -> Result<f64, ArtifactError> {
        let max_abs = self.calibration.tensor("input.max_abs", &[1])?[0];
        Ok(f64::from(max_abs) * HEAD_ROOM / 127.0)
    }

    fn check(&self) -> Result<(), ArtifactError> {
        validation::check_description(&self.description)?;
        validation::check_weights(&self.description, &self.weights)?;
        validation::check_calibration(&self.description, &self.calibration)?;
        match &self.packed {
            Some(packed) => packed.check(&self.description),
            None => Ok(()),
        }
    }

    fn to_bytes(&self) -> Result<FileBytes, ArtifactError> {
        let toml = toml::to_string(&self.description)?;
        Ok(FileBytes {
            // One grid row per line, for human readers.
            description: toml
                .replace("[[\"", "[\n    [\"")
                .replace("], [", "],\n    [")
                .replace("\"]]", "\"],\n]"),
            weights: self.weights.to_bytes()?,
            calibration: self.calibration.to_bytes()?,
            packed: self
                .packed
                .as_ref()
                .map(PackedModel::to_files)
                .transpose()?,
        })
    }
}

#[cfg(test)]
mod tests;
