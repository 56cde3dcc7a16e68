//! Provenance and test figures of a model.

use serde::{Deserialize, Serialize};

/// Training data, training settings and test figures of a model: the table `[training]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingCard {
    /// Origin and licence of the recordings.
    pub dataset: String,
    /// References to cite when the model is used.
    pub citation: String,
    /// Number of electrodes that were recorded.
    pub real_electrodes: usize,
    /// Number of electrodes that were interpolated from recorded ones.
    pub interpolated_electrodes: usize,
    /// Labels of the interpolated electrodes.
    pub interpolated: Vec<String>,
    /// Caveats about the test figures.
    pub note: String,
    /// Names of the training files.
    pub train_files: Vec<String>,
    /// Names of the test files, which were not used for training or validation.
    pub test_files: Vec<String>,
    /// Data on which the best epoch was chosen, in words.
    pub validation: String,
    /// Mains frequency of the recordings, Hz.
    pub mains_hz: u32,
    /// Seed of all random numbers in training.
    pub seed: u64,
    /// Number of epochs in the training run.
    pub epochs: u32,
    /// Epoch whose weights were kept; 0 means the initial weights (PCA in mode `shortcut`).
    pub best_epoch: u32,
    /// Training windows per epoch.
    pub windows: u64,
    /// Optimiser, learning-rate schedule and batch size, in words.
    pub optimiser: String,
    /// Mean squared error over all electrodes of the test files, in units of `input.sd_uv` squared;
    /// absent if not measured.
    pub mse: Option<Figures>,
    /// Percent root-mean-square difference on the test files: the root of the summed squared error,
    /// divided by the root of the summed squared signal; absent if not measured.
    pub prd_percent: Option<Figures>,
}

/// One kind of reconstruction error: of the model, and of PCA for comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// Error of the autoencoder with float encoder and float decoder.
    pub autoencoder_float: f64,
    /// Error of the autoencoder with integer encoder and float decoder.
    pub autoencoder_int8: f64,
    /// Error of PCA in float, with one component for each number of a code.
    pub pca_float: f64,
    /// Error of PCA with integer encoder and float decoder.
    pub pca_int8: f64,
}
