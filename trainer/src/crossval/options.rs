//! Options of a cross-validation.

use super::shard::Shard;
use crate::card::Shape;
use crate::training::Settings;
use artifact::MontageFile;
use std::path::PathBuf;

/// Options of `trainer crossval`.
#[derive(Clone, Debug)]
pub struct CrossvalOptions {
    /// Recordings of all subjects.
    pub recordings: Vec<PathBuf>,
    /// Name of the only subject; `None` to group the recordings by their names.
    pub subject: Option<String>,
    /// Grid, order of the ADC's channels and ADC.
    pub montage: MontageFile,
    /// Mode and dimensions of the model.
    pub shape: Shape,
    /// Mains frequency of the recordings, Hz.
    pub mains_hz: u32,
    /// Epochs, batch size, learning rate and first seed.
    pub settings: Settings,
    /// Number of folds of each repetition.
    pub folds: usize,
    /// Number of repetitions, each with another split into folds.
    pub repetitions: usize,
    /// Number of contiguous blocks of each recording; `None` for whole runs where a subject has at least a
    /// run for each fold, and otherwise for at least two blocks in each fold.
    pub blocks: Option<usize>,
    /// The folds that this process computes.
    pub shard: Shard,
    /// Folder of outcomes and tables.
    pub out: PathBuf,
}
