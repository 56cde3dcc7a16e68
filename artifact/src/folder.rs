use crate::description::Description;
use crate::error::ArtifactError;
use crate::model_id::ModelId;
use crate::tensors::Tensors;
use crate::validation;
use std::path::Path;

/// Name of the description's file.
const DESCRIPTION: &str = "model.toml";
/// Name of the weights' file.
pub(crate) const WEIGHTS: &str = "weights.safetensors";
/// Name of the calibration's file.
pub(crate) const CALIBRATION: &str = "calibration.safetensors";

/// A trained model: description, weights and calibration that belong together.
///
/// Every way to get one checks it: what reading and [`Artifact::new`] return has all tensors of its
/// mode in the right shapes, finite numbers, and a montage that fits the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Artifact {
    /// What training decided besides the weights.
    pub description: Description,
    /// Encoder and decoder, f32.
    pub weights: Tensors,
    /// The ranges from which int8 scales are chosen, f32.
    pub calibration: Tensors,
    /// Names the model: a hash over its files.
    pub id: ModelId,
}

/// The bytes of the files that the model id covers.
struct FileBytes {
    description: String,
    weights: Vec<u8>,
    calibration: Vec<u8>,
}

impl FileBytes {
    fn named(&self) -> [(&str, &[u8]); 3] {
        [
            (DESCRIPTION, self.description.as_bytes()),
            (WEIGHTS, &self.weights),
            (CALIBRATION, &self.calibration),
        ]
    }
}

impl Artifact {
    /// A model from its parts, with the id that [`Artifact::write`] will give it.
    ///
    /// # Errors
    /// When the parts do not make a model.
    pub fn new(
        description: Description,
        weights: Tensors,
        calibration: Tensors,
    ) -> Result<Self, ArtifactError> {
        let mut artifact = Self {
            description,
            weights,
            calibration,
            id: ModelId([0; 8]),
        };
        artifact.check()?;
        artifact.id = ModelId::of(artifact.to_bytes()?.named());
        Ok(artifact)
    }

    /// Reads the folder of an artifact.
    ///
    /// # Errors
    /// When a file cannot be read or the files do not make a model.
    pub fn read(folder: &Path) -> Result<Self, ArtifactError> {
        let read = |name: &str| {
            let path = folder.join(name);
            std::fs::read(&path).map_err(|source| ArtifactError::File { path, source })
        };
        let path = folder.join(DESCRIPTION);
        let description = std::fs::read_to_string(&path)
            .map_err(|source| ArtifactError::File { path, source })?;
        Self::from_bytes(&description, &read(WEIGHTS)?, &read(CALIBRATION)?)
    }

    /// A model from the contents of its files, for programs that embed them.
    ///
    /// # Errors
    /// When the contents do not make a model.
    pub fn from_bytes(
        model_toml: &str,
        weights: &[u8],
        calibration: &[u8],
    ) -> Result<Self, ArtifactError> {
        let files = [
            (DESCRIPTION, model_toml.as_bytes()),
            (WEIGHTS, weights),
            (CALIBRATION, calibration),
        ];
        let artifact = Self {
            description: toml::from_str(model_toml)?,
            weights: Tensors::from_bytes(WEIGHTS, weights)?,
            calibration: Tensors::from_bytes(CALIBRATION, calibration)?,
            id: ModelId::of(files),
        };
        artifact.check()?;
        Ok(artifact)
    }

    /// Writes the three files of the model id into a folder, which is made when absent, and returns
    /// the id of what was written. It equals `self.id` unless a part was changed since, or
    /// `model.toml` was written by hand.
    ///
    /// # Errors
    /// When the parts do not make a model or a file cannot be written.
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
        Ok(ModelId::of(bytes.named()))
    }

    fn check(&self) -> Result<(), ArtifactError> {
        validation::description(&self.description)?;
        validation::weights(&self.description, &self.weights)?;
        validation::calibration(&self.description, &self.calibration)
    }

    fn to_bytes(&self) -> Result<FileBytes, ArtifactError> {
        let toml = toml::to_string(&self.description)?;
        Ok(FileBytes {
            // One row of the grid on a line: the grid is read by people.
            description: toml
                .replace("[[\"", "[\n    [\"")
                .replace("], [", "],\n    [")
                .replace("\"]]", "\"],\n]"),
            weights: self.weights.to_bytes()?,
            calibration: self.calibration.to_bytes()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{NetworkShape, Padding};
    use crate::testing;

    #[test]
    fn what_is_written_reads_back_with_the_same_id() {
        let folder = tempfile::tempdir().unwrap();
        for artifact in [testing::pca(), testing::shortcut()] {
            let id = artifact.write(folder.path()).unwrap();
            let read = Artifact::read(folder.path()).unwrap();
            assert_eq!(read, artifact);
            assert_eq!(read.id, id);
        }
    }

    #[test]
    fn every_file_of_the_model_changes_the_id() {
        let artifact = testing::pca();
        let mut described = artifact.clone();
        described.description.filters.notch_q = 31.0;
        let mut weighted = artifact.clone();
        let one = vec![1.0; crate::CODE * crate::WINDOW_ELECTRODES];
        weighted.weights.insert(
            "encoder.shortcut.weight",
            &[crate::CODE, crate::WINDOW_ELECTRODES],
            one,
        );
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
    fn a_missing_folder_says_what_it_should_be() {
        let error = Artifact::read(Path::new("/nowhere")).unwrap_err();
        assert!(error.to_string().contains("/nowhere/model.toml"), "{error}");
    }

    #[test]
    fn a_misspelt_field_is_refused_by_name() {
        let bytes = testing::pca().to_bytes().unwrap();
        let misspelt = bytes.description.replace("notch_q", "notch_Q");
        let error =
            Artifact::from_bytes(&misspelt, &bytes.weights, &bytes.calibration).unwrap_err();
        let ArtifactError::Toml(source) = error else {
            panic!("{error}")
        };
        assert!(source.to_string().contains("notch_Q"), "{source}");
    }

    #[test]
    fn impossible_descriptions_are_refused_by_field() {
        type Change = fn(&mut Description);
        let cases: [(Change, &str); 17] = [
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
            (|d| d.montage.electrodes.truncate(60), "montage.electrodes"),
            (|d| d.adc.rate_hz = 500, "adc.rate_hz"),
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
            let mut artifact = testing::pca();
            change(&mut artifact.description);
            let error = artifact.check().unwrap_err();
            let ArtifactError::Field { field, .. } = error else {
                panic!("{error}")
            };
            assert_eq!(field, expected);
        }
    }

    #[test]
    fn a_refused_pool_is_told_what_would_fit() {
        let refusal = |padding, pool| {
            let mut artifact = testing::pca();
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
            let mut artifact = testing::pca();
            artifact.description.network = NetworkShape { padding, pool };
            artifact.check().unwrap();
        }
    }

    #[test]
    fn a_montage_that_does_not_fit_the_grid_is_refused_by_label() {
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
