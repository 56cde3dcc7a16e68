//! The contents of `packed.toml`.

use serde::{Deserialize, Serialize};

/// Dimensions and units of a packed model, and how it was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedDescription {
    /// Version of the format, 1.
    pub format: u32,
    /// Number of coefficients of a block: a multiple of 16, at most 256, and at most the values of
    /// a block.
    pub coefficients: usize,
    /// Rate that a device starts with, 0..=15.
    pub rate: u8,
    /// Microvolts of one unit of an input value, and of a coefficient.
    pub unit_uv: f64,
    /// Largest magnitude of an input value; larger ones are clipped to it.
    pub input_limit: i16,
    /// Mean square of the part of a block that its coefficients do not represent, microvolts
    /// squared; a block with more is flagged as a misfit.
    pub misfit_uv2: f64,
    /// Recordings that it was trained on, and its figures on the test recordings.
    pub training: PackedTraining,
}

/// How a packed model was trained.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedTraining {
    /// File names of the training recordings.
    pub train_files: Vec<String>,
    /// File names of the test recordings.
    pub test_files: Vec<String>,
    /// Figures on the test recordings, one entry for each measured rate.
    pub figures: Vec<PackedFigures>,
    /// Figures of the Karhunen-Loeve transform of a block with the same number of coefficients,
    /// trained and coded alike but without prediction; empty without test recordings. Its second
    /// error equals the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without_prediction: Vec<PackedFigures>,
}

/// Figures of one rate on the test recordings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedFigures {
    /// The rate, 0..=15.
    pub rate: u8,
    /// Bits of a block, mean.
    pub bits: f64,
    /// Mean squared error in the unit of the network's input, at once.
    pub mse: f64,
    /// Mean squared error after the smoother, one block later.
    pub mse_smoothed: f64,
}
