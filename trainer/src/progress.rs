//! Progress of a training run, an evaluation or a cross-validation.

use crate::crossval::Outcome;

/// Losses of one epoch, for the progress display.
#[derive(Clone, Copy, Debug)]
pub struct EpochReport {
    /// Number of the epoch, from 1.
    pub epoch: u32,
    /// Mean loss over the batches of the epoch.
    pub loss: f64,
    /// Mean squared error on the validation windows after the epoch, in units of `input.sd_uv`
    /// squared.
    pub validation: f64,
}

/// Receives the progress of a command. All methods but the first do nothing by default.
pub trait ProgressObserver {
    /// Reports a message for the user, one line.
    fn message(&mut self, text: &str);

    /// Reports the start of epoch `epoch` of `epochs`, which has `batches` batches of `windows`
    /// windows.
    fn epoch_started(&mut self, _epoch: u32, _epochs: u32, _batches: usize, _windows: usize) {}

    /// Reports the end of a batch and its loss.
    fn batch_finished(&mut self, _loss: f64) {}

    /// Reports the losses of a finished epoch.
    fn epoch_finished(&mut self, _report: EpochReport) {}

    /// Returns whether the user asked to stop. Called after each batch.
    fn is_interrupted(&self) -> bool {
        false
    }

    /// Reports the start of a fold of a cross-validation, and its number among the `folds` folds of
    /// this shard.
    fn fold_started(&mut self, _name: &str, _number: usize, _folds: usize) {}

    /// Reports the outcome of a finished fold.
    fn fold_finished(&mut self, _outcome: &Outcome) {}
}
