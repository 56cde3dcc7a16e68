//! Shows the progress of a command in the terminal.

use crate::crossval::Outcome;
use crate::error::TrainerError;
use crate::progress::ProgressObserver;
use crate::training::EpochLosses;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use signal_hook::consts::SIGINT;
use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Prints progress to standard error: lines, and a bar over all epochs or folds with the remaining
/// time.
pub(crate) struct Terminal {
    bar: ProgressBar,
    start: Option<Instant>,
    /// Number of batches in an epoch, and of windows in a batch.
    size: [usize; 2],
    /// Number of batches finished by this process.
    finished: usize,
    interrupted: Arc<AtomicBool>,
}

impl Terminal {
    /// Creates a display that does not catch Ctrl-C: Ctrl-C ends the program.
    pub(crate) fn new() -> Self {
        Self {
            bar: ProgressBar::hidden(),
            start: None,
            size: [0; 2],
            finished: 0,
            interrupted: Arc::new(AtomicBool::new(false)),
        }
    }

    /// Creates a display that catches Ctrl-C: the first one stops a training run after its current
    /// batch, and the second one ends the program.
    ///
    /// # Errors
    /// If the system refuses to report Ctrl-C.
    pub(crate) fn with_interrupt() -> Result<Self, TrainerError> {
        let terminal = Self::new();
        let interrupted = &terminal.interrupted;
        signal_hook::flag::register_conditional_shutdown(SIGINT, 130, interrupted.clone())
            .and_then(|_| signal_hook::flag::register(SIGINT, interrupted.clone()))
            .map_err(TrainerError::Signals)?;
        Ok(terminal)
    }

    fn windows_per_second(&self) -> f64 {
        let seconds = self.start.map_or(0.0, |start| start.elapsed().as_secs_f64());
        (self.finished * self.size[1]) as f64 / seconds.max(1e-3)
    }
}

impl ProgressObserver for Terminal {
    fn message(&mut self, text: &str) {
        self.bar.suspend(|| new_file::message!("{text}"));
    }

    fn epoch_started(&mut self, epoch: u32, epochs: u32, batches: usize, windows: usize) {
        if self.start.is_none() {
            let style = "epoch {prefix} {bar:30} {pos}/{len} batches, {eta} left, {msg}";
            let done = u64::from(epoch - 1) * batches as u64;
            self.bar = bar(style, u64::from(epochs) * batches as u64);
            self.bar.set_position(done);
            self.bar.reset_eta();
            self.start = Some(Instant::now());
            self.size = [batches, windows];
        }
        self.bar.set_prefix(format!("{epoch}/{epochs}"));
    }

    fn batch_finished(&mut self, loss: f64) {
        self.finished += 1;
        self.bar.inc(1);
        let speed = self.windows_per_second();
        self.bar.set_message(format!("{speed:.0} windows/s, loss {loss:.5}"));
    }

    fn epoch_finished(&mut self, epoch: u32, EpochLosses { loss, validation }: EpochLosses) {
        if self.start.is_none() {
            // In a cross-validation the bar counts folds, so an epoch changes only its text.
            let text = format!("epoch {epoch}, validation MSE {validation:.5}");
            self.bar.set_message(text);
            return;
        }
        let speed = self.windows_per_second();
        self.message(&format!(
            "epoch {epoch}: training loss {loss:.5}, validation MSE {validation:.5}, {speed:.0} \
             windows/s"
        ));
    }

    fn folds_planned(&mut self, work: usize) {
        let style = ProgressStyle::with_template("{prefix} {bar:30} {left}, {msg}");
        let style = style.expect("a template with known keys");
        let style = style.with_key("left", |state: &ProgressState, out: &mut dyn Write| {
            let done = state.pos() as f64 / state.len().unwrap_or(0).max(1) as f64;
            let left = remaining(state.elapsed(), done);
            // Writing to the bar's text cannot fail.
            let _ = match left {
                Some(left) => write!(out, "{} left", HumanDuration(left)),
                None => write!(out, "time left unknown"),
            };
        });
        self.bar = ProgressBar::new(work as u64).with_style(style);
    }

    fn fold_started(&mut self, name: &str, number: usize, folds: usize) {
        self.bar.set_prefix(format!("{name}, fold {number} of {folds}"));
    }

    fn fold_finished(&mut self, outcome: &Outcome, work: usize) {
        self.bar.inc(work as u64);
        let model = outcome.model_float.map_or(f64::NAN, |errors| errors.mse);
        self.message(&format!(
            "{}: MSE {model:.5}, PCA {:.5}; validation {:.5}, PCA {:.5}; best epoch {}; tested on {}",
            outcome.name(),
            outcome.pca_float.mse,
            outcome.validation.model,
            outcome.validation.pca,
            outcome.best_epoch,
            outcome.tested_on
        ));
    }

    fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

/// Returns the remaining time after a fraction of the work, from 0 to 1, has taken `elapsed`;
/// `None` if nothing is done yet. Folds take minutes and differ in duration, so the estimate uses
/// the mean speed so far, not the recent speed.
fn remaining(elapsed: Duration, done: f64) -> Option<Duration> {
    (done > 0.0).then(|| elapsed.mul_f64((1.0 - done) / done))
}

fn bar(style: &str, length: u64) -> ProgressBar {
    let style = ProgressStyle::with_template(style).expect("a template with known keys");
    ProgressBar::new(length).with_style(style)
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_holds_for_folds_of_different_size() {
        // Folds with 1, 7 and 2 units of work take 10 s for each unit.
        let mut done = 0.0;
        for work in [1.0, 7.0, 2.0] {
            done += work;
            let left = remaining(Duration::from_secs_f64(10.0 * done), done / 10.0);
            let expected = 100.0 - 10.0 * done;
            assert!((left.unwrap().as_secs_f64() - expected).abs() < 1e-6);
        }
        assert_eq!(remaining(Duration::from_secs(1), 0.0), None);
    }
}
