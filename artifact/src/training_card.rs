use serde::{Deserialize, Serialize};

/// How and on what a model was trained, and how well it does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingCard {
    /// The recordings' origin and licence.
    pub dataset: String,
    /// What to cite when the model is used.
    pub citation: String,
    /// Electrodes that the recordings have themselves.
    pub real_electrodes: usize,
    /// Electrodes that were computed from others.
    pub interpolated_electrodes: usize,
    /// Labels of the electrodes that were computed from others.
    pub interpolated: Vec<String>,
    /// What a reader of the figures should know.
    pub note: String,
    /// Names of the files trained on.
    pub train_files: Vec<String>,
    /// Names of the files that the figures come from; never trained or validated on.
    pub test_files: Vec<String>,
    /// How the best epoch was chosen.
    pub validation: String,
    /// Mains frequency where the recordings were made, Hz.
    pub mains_hz: u32,
    /// Seed of every random choice.
    pub seed: u64,
    /// Epochs that were run.
    pub epochs: u32,
    /// The epoch whose weights these are; 0 is the start (PCA in mode `shortcut`).
    pub best_epoch: u32,
    /// Windows per epoch.
    pub windows: u64,
    /// Optimiser, schedule and batch in words.
    pub optimiser: String,
    /// Mean squared error on the test files over the 61 electrodes, in units of `input.sd_uv`
    /// squared; absent when it was not measured.
    pub mse: Option<Figures>,
    /// Root of the squared error over the root of the squared signal on the test files, percent;
    /// absent when it was not measured.
    pub prd_percent: Option<Figures>,
}

/// One figure of merit of the model beside that of its linear peer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// The network in float.
    pub autoencoder_float: f64,
    /// The integer encoder's codes, decoded in float.
    pub autoencoder_int8: f64,
    /// PCA with as many components as the code has numbers, in float.
    pub pca_float: f64,
    /// The same with int8 codes.
    pub pca_int8: f64,
}
