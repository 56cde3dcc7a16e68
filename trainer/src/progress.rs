//! Progress of a training run, an evaluation or a cross-validation.

use crate::crossval::Outcome;
use crate::training::EpochLosses;

/// Receives the progress of a command. All methods but the first do nothing by default.
pub trait ProgressObserver {
    /// Reports a message for the user, one line.
    fn message(&mut self, text: &str);

    /// Reports the start of epoch `epoch` of `epochs`, which has `batches` batches of `windows`
    /// windows.
    fn epoch_started(&mut self, _epoch: u32, _epochs: u32, _batches: usize, _windows: usize) {}

    /// Reports the end of a batch and its loss.
    fn batch_finished(&mut self, _loss: f64) {}

    /// Reports the losses of a finished epoch, whose number counts from 1.
    fn epoch_finished(&mut self, _epoch: u32, _losses: EpochLosses) {}

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
