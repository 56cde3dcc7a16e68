//! Messages on standard error.

use trainer::progress::{EpochReport, ProgressObserver};

/// Prints messages to standard error. A check has no epochs and is not interrupted.
pub(crate) struct Log;

impl ProgressObserver for Log {
    fn message(&mut self, text: &str) {
        eprintln!("{text}");
    }

    fn epoch_started(&mut self, _: u32, _: u32, _: usize, _: usize) {}

    fn batch_finished(&mut self, _: usize, _: f64) {}

    fn epoch_finished(&mut self, _: EpochReport) {}

    fn is_interrupted(&self) -> bool {
        false
    }
}
