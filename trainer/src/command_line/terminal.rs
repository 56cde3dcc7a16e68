//! Progress on the terminal.

use indicatif::{ProgressBar, ProgressStyle};
use signal_hook::consts::SIGINT;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use trainer::error::TrainerError;
use trainer::progress::{EpochReport, ProgressObserver};

/// Prints progress to standard error: lines, and a bar over all epochs with windows per second and the time left.
pub(crate) struct Terminal {
    bar: ProgressBar,
    start: Option<Instant>,
    /// Number of batches of an epoch, and of windows in a batch.
    size: [usize; 2],
    /// Number of batches finished by this process.
    finished: usize,
    interrupted: Arc<AtomicBool>,
}

impl Terminal {
    /// Creates the display. The first Ctrl-C stops a training after its present batch, the second ends the program.
    ///
    /// # Errors
    /// If the system refuses to report Ctrl-C.
    pub(crate) fn new() -> Result<Self, TrainerError> {
        let interrupted = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register_conditional_shutdown(SIGINT, 130, interrupted.clone())
            .and_then(|_| signal_hook::flag::register(SIGINT, interrupted.clone()))
            .map_err(TrainerError::Signals)?;
        Ok(Self {
            bar: ProgressBar::hidden(),
            start: None,
            size: [0; 2],
            finished: 0,
            interrupted,
        })
    }

    #[expect(clippy::cast_precision_loss, reason = "for display")]
    fn windows_per_second(&self) -> f64 {
        let seconds = self
            .start
            .map_or(0.0, |start| start.elapsed().as_secs_f64());
        (self.finished * self.size[1]) as f64 / seconds.max(1e-3)
    }
}

impl ProgressObserver for Terminal {
    fn message(&mut self, text: &str) {
        self.bar.suspend(|| eprintln!("{text}"));
    }

    fn epoch_started(&mut self, epoch: u32, epochs: u32, batches: usize, windows: usize) {
        if self.start.is_none() {
            let style = "epoch {prefix} {bar:30} {pos}/{len} batches, {eta} left, {msg}";
            let style = ProgressStyle::with_template(style).expect("a template with known keys");
            let done = u64::from(epoch - 1) * batches as u64;
            self.bar = ProgressBar::new(u64::from(epochs) * batches as u64).with_style(style);
            self.bar.set_position(done);
            self.bar.reset_eta();
            self.start = Some(Instant::now());
            self.size = [batches, windows];
        }
        self.bar.set_prefix(format!("{epoch}/{epochs}"));
    }

    fn batch_finished(&mut self, _batches: usize, loss: f64) {
        self.finished += 1;
        self.bar.inc(1);
        let speed = self.windows_per_second();
        self.bar
            .set_message(format!("{speed:.0} windows/s, loss {loss:.5}"));
    }

    fn epoch_finished(&mut self, report: EpochReport) {
        let EpochReport {
            epoch,
            loss,
            validation,
        } = report;
        let speed = self.windows_per_second();
        self.message(&format!(
            "epoch {epoch}: training loss {loss:.5}, validation MSE {validation:.5}, {speed:.0} windows/s"
        ));
    }

    fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Prints an error with its causes to standard error.
pub(super) fn print_error(error: &dyn Error) {
    eprintln!("trainer: {error}");
    let mut cause = error.source();
    while let Some(error) = cause {
        eprintln!("  because {error}");
        cause = error.source();
    }
}
