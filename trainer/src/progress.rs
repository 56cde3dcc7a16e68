//! Progress of a training run or an evaluation.

/// Losses of one epoch, for the progress display.
#[derive(Clone, Copy, Debug)]
pub struct EpochReport {
    /// Number of the epoch, from 1.
    pub epoch: u32,
    /// Mean loss over the batches of the epoch.
    pub loss: f64,
    /// Mean squared error on the validation windows after the epoch, in units of `input.sd_uv` squared.
    pub validation: f64,
}

/// Receives the progress of a training run or an evaluation.
pub trait ProgressObserver {
    /// Reports a message for the user, one line.
    fn message(&mut self, text: &str);
    /// Reports the start of epoch `epoch` of `epochs`, which has `batches` batches of `windows` windows.
    fn epoch_started(&mut self, epoch: u32, epochs: u32, batches: usize, windows: usize);
    /// Reports the number of batches finished in this epoch, and the loss of the last batch.
    fn batch_finished(&mut self, batches: usize, loss: f64);
    /// Reports that an epoch is finished, with its losses.
    fn epoch_finished(&mut self, report: EpochReport);
    /// Returns whether the user asked to stop. It is asked after each batch.
    fn is_interrupted(&self) -> bool;
}
