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
mod tests {
    use super::*;
    use crate::description::{Grid, NetworkShape, Padding, Window};
    use crate::testing;

    #[test]
    fn a_written_model_reads_back_with_the_same_id() {
        let folder = tempfile::tempdir().unwrap();
        let mut small = testing::description();
        small.window = Window {
            steps: 32,
            hop: 4,
            rate_hz: 128,
        };
        small.code.numbers = 8;
        let labels = ["C3", "Cz", "C4", "Pz"].map(str::to_owned);
        small.grid = Grid::new(vec![labels.to_vec()]);
        small.montage.electrodes = labels.to_vec();
        (small.adc.rate_hz, small.adc.channels) = (256, 8);
        (
            small.training.real_electrodes,
            small.training.interpolated_electrodes,
        ) = (4, 0);
        small.training.interpolated.clear();
        let small = testing::pca_with(small);
        for artifact in [testing::pca(), testing::shortcut(), small] {
            let id = artifact.write(folder.path()).unwrap();
            let read = Artifact::read(folder.path()).unwrap();
            assert_eq!(read, artifact);
            assert_eq!(read.id, id);
        }
    }

    #[test]
    fn a_change_in_any_file_changes_the_id() {
        let artifact = testing::pca();
        let mut described = artifact.clone();
        described.description.filters.notch_q = 31.0;
        let mut weighted = artifact.clone();
        let one = vec![1.0; 128 * 16 * 61];
        weighted
            .weights
            .insert("encoder.shortcut.weight", &[128, 16 * 61], one);
        let mut calibrated = artifact.clone();
        calibrated
            .calibration
            .insert("input.max_abs", &[1], vec![99.0]);
        for changed in [described, weighted, calibrated] {
            let folder = tempfile::tempdir().unwrap();
            assert_ne!(changed.write(folder.path()).unwrap(), artifact.id);
        }
    }

    #[test]
    fn the_written_description_has_one_grid_row_on_a_line() {
        let text = testing::pca().to_bytes().unwrap().description;
        assert!(text.contains("    [\"FTT7\", \"FCC5\","), "{text}");
    }

    #[test]
    fn the_error_of_a_missing_folder_names_the_missing_file() {
        let error = Artifact::read(Path::new("/nowhere")).unwrap_err();
        assert!(error.to_string().contains("/nowhere/model.toml"), "{error}");
    }

    #[test]
    fn the_error_of_a_misspelt_field_names_it() {
        let bytes = testing::pca().to_bytes().unwrap();
        let misspelt = bytes.description.replace("notch_q", "notch_Q");
        let error =
            Artifact::from_bytes(&misspelt, &bytes.weights, &bytes.calibration, None).unwrap_err();
        let ArtifactError::Toml(source) = error else {
            panic!("{error}")
        };
        assert!(source.to_string().contains("notch_Q"), "{source}");
    }

    #[test]
    fn the_error_of_an_invalid_description_names_the_field() {
        type Change = fn(&mut Description);
        let cases: [(Change, &str); 29] = [
            (|d| d.format = 2, "format"),
            (|d| d.window.hop = 7, "window.hop"),
            (|d| d.network.pool = [0, 2, 2], "network.pool"),
            (|d| d.network.pool = [2, 2, 0], "network.pool"),
            (|d| d.network.pool = [2, 7, 2], "network.pool"),
            (|d| d.network.pool = [16, 2, 2], "network.pool"),
            (|d| d.network.pool = [3, 2, 2], "network.pool"),
            (
                |d| {
                    d.network.padding = Padding::All;
                    d.network.pool = [4, 2, 2];
                },
                "network.pool",
            ),
            (|d| d.grid.cells.truncate(9), "grid.cells"),
            (|d| d.montage.electrodes.truncate(3), "montage.electrodes"),
            (|d| d.adc.rate_hz = 500, "adc.rate_hz"),
            (|d| d.adc.rate_hz = 2000, "adc.rate_hz"),
            (|d| d.adc.gain = 7, "adc.gain"),
            (|d| d.adc.vref_v = 2.5, "adc.vref_v"),
            (|d| d.adc.channels = 62, "adc.channels"),
            (|d| d.adc.channels = 72, "adc.channels"),
            (|d| d.window.steps = 24, "window.steps"),
            (|d| d.code.numbers = 4, "code.numbers"),
            (|d| d.code.numbers = 260, "code.numbers"),
            (|d| d.code.numbers = 30, "code.numbers"),
            (
                |d| d.grid = Grid::new(vec![vec!["Cz".to_owned(); 13]]),
                "grid.columns",
            ),
            (|d| d.grid = Grid::new(vec![vec![]]), "grid.columns"),
            (|d| d.grid = Grid::new(vec![]), "grid.rows"),
            (|d| d.adc.rate_hz = 0, "adc.rate_hz"),
            (|d| d.adc.channels = 60, "adc.channels"),
            (|d| d.filters.band_hz = [0.5, 256.0], "filters.band_hz"),
            (|d| d.filters.harmonics = 4, "filters.harmonics"),
            (|d| d.input.sd_uv = f64::NAN, "input.sd_uv"),
            (
                |d| d.training.interpolated_electrodes = 0,
                "training.interpolated",
            ),
        ];
        for (change, expected) in cases {
            let mut artifact = testing::shortcut();
            change(&mut artifact.description);
            let error = artifact.check().unwrap_err();
            let ArtifactError::Field { field, .. } = error else {
                panic!("{error}")
            };
            assert_eq!(field, expected);
        }
    }

    #[test]
    fn the_error_of_an_invalid_pool_states_the_valid_sizes() {
        let refusal = |padding, pool| {
            let mut artifact = testing::shortcut();
            artifact.description.network = NetworkShape { padding, pool };
            artifact.check().unwrap_err().to_string()
        };
        let text = refusal(Padding::None, [2, 7, 2]);
        assert!(
            text.contains("[2, 7, 2]") && text.contains("[12, 6, 5]"),
            "{text}"
        );
        let text = refusal(Padding::All, [4, 2, 2]);
        assert!(text.contains("1 or 2 steps"), "{text}");
        for (padding, pool) in [
            (Padding::None, [4, 6, 5]),
            (Padding::Space, [4, 10, 9]),
            (Padding::All, [1, 1, 1]),
        ] {
            let mut description = testing::description();
            description.network = NetworkShape { padding, pool };
            testing::shortcut_with(description);
        }
    }

    #[test]
    fn the_error_of_a_montage_that_does_not_fit_the_grid_names_the_label() {
        type Change = fn(&mut Description);
        let cases: [(Change, &str); 4] = [
            (|d| d.montage.electrodes[3] = "F9".to_owned(), "F2"),
            (|d| d.montage.electrodes[3] = "F3".to_owned(), "F3"),
            (|d| d.grid.cells[0][0] = "F3".to_owned(), "F3"),
            (|d| d.montage.electrodes[0] = "F 3".to_owned(), "F 3"),
        ];
        for (change, expected) in cases {
            let mut artifact = testing::pca();
            change(&mut artifact.description);
            let error = artifact.check().unwrap_err();
            let ArtifactError::Label { label, .. } = error else {
                panic!("{error}")
            };
            assert_eq!(label, expected);
        }
    }

    #[test]
    fn empty_ranges_and_negative_variances_are_refused() {
        let mut artifact = testing::shortcut();
        artifact
            .weights
            .insert("encoder.norm1.running_var", &[16], vec![-1.0; 16]);
        assert!(matches!(artifact.check(), Err(ArtifactError::Range { .. })));
        let mut artifact = testing::shortcut();
        artifact
            .calibration
            .insert("code.min", &[128], vec![1.0; 128]);
        assert!(matches!(artifact.check(), Err(ArtifactError::Range { .. })));
        let mut artifact = testing::shortcut();
        artifact
            .calibration
            .insert("activation1.max", &[1], vec![0.0]);
        assert!(matches!(artifact.check(), Err(ArtifactError::Range { .. })));
    }
}
