//! The model that decodes codes.

use std::path::{Path, PathBuf};

use ::model::artifact_files::FILES;
use artifact::reconstruction::WindowDecoder;
use artifact::{Artifact, ArtifactError, Description, ModelId, PackedModel};

use crate::error::OfflineError;

/// A model with its decoders.
#[derive(Debug, Clone)]
pub struct Model {
    /// Id of the model. Codes carry the id of the model that they were made with.
    pub id: ModelId,
    /// Dimensions, montage and filters of the model.
    pub description: Description,
    pub(crate) decoder: WindowDecoder,
    pub(crate) packed: Option<PackedModel>,
}

impl Model {
    /// Reads the model that is built into this program.
    ///
    /// # Errors
    /// [`OfflineError::Model`] if the model's decoder needs other input in addition to the code.
    pub fn embedded() -> Result<Self, OfflineError> {
        Artifact::from_files(FILES)
            .and_then(|artifact| Self::new(&artifact))
            .map_err(|error| OfflineError::Model(PathBuf::from("this program"), error))
    }

    /// Reads the model in a folder.
    ///
    /// # Errors
    /// [`OfflineError::Model`] if the folder holds no valid model, or if the model's decoder needs
    /// other input in addition to the code.
    pub fn read(folder: &Path) -> Result<Self, OfflineError> {
        Artifact::read(folder)
            .and_then(|artifact| Self::new(&artifact))
            .map_err(|error| OfflineError::Model(folder.to_owned(), error))
    }

    /// Returns whether this model is built into the program. The program can filter recordings only
    /// for its built-in model.
    pub fn is_built_in(&self) -> bool {
        self.id.0 == ::model::MODEL_ID
    }

    fn new(artifact: &Artifact) -> Result<Self, ArtifactError> {
        Ok(Self {
            id: artifact.id,
            description: artifact.description.clone(),
            decoder: WindowDecoder::new(artifact)?,
            packed: artifact.packed.clone(),
        })
    }
}
