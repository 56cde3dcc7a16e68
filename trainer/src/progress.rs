//! Interface through which a command reports its progress and learns of a request to stop.

use crate::crossval::Outcome;
use crate::training::EpochLosses;

/// Receives the progress of a command. All methods except [`message`](Self::message) do nothing by
/// default.
pub trait ProgressObserver {
    /// Reports a one-line message to the user.
    fn message(&mut self, text: &str);

    /// Reports the start of epoch `epoch` of `epochs`, which has `batches` batches of `windows`
    /// windows.
    fn epoch_started(&mut self, _epoch: u32, _epochs: u32, _batches: usize, _windows: usize) {}

    /// Reports the end of a batch and its loss.
    fn batch_finished(&mut self, _loss: f64) {}

    /// Reports the losses of a finished epoch; epochs are counted from 1.
    fn epoch_finished(&mut self, _epoch: u32, _losses: EpochLosses) {}

    /// Returns whether the user has asked to stop. Training calls this after each batch.
    fn is_interrupted(&self) -> bool {
        false
    }

    /// Reports the total work of all unfinished folds of a cross-validation: the number of blocks
    /// to train on.
    fn folds_planned(&mut self, _work: usize) {}

    /// Reports the start of a fold of a cross-validation, and its number among the `folds`
    /// unfinished folds.
    fn fold_started(&mut self, _name: &str, _number: usize, _folds: usize) {}

    /// Reports the outcome of a finished fold, and its work: the number of blocks that were trained
    /// on, as in [`folds_planned`](Self::folds_planned).
    fn fold_finished(&mut self, _outcome: &Outcome, _work: usize) {}
}
