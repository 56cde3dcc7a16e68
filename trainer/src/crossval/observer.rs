//! Progress of a cross-validation.

use super::outcome::Outcome;

/// Receives the progress of a cross-validation.
pub trait CrossvalObserver {
    /// Reports a message for the user, one line.
    fn message(&mut self, text: &str);
    /// Reports the start of a fold, and its number among all folds of this shard.
    fn fold_started(&mut self, name: &str, number: usize, folds: usize);
    /// Reports that `epoch` of `epochs` of the current fold is finished.
    fn epoch_finished(&mut self, epoch: u32, epochs: u32, validation: f64);
    /// Reports the outcome of the current fold.
    fn fold_finished(&mut self, outcome: &Outcome);
}
