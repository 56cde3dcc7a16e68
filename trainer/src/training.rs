//! A training run: its learning rate, its epochs, their errors, and the best parameters so far.

use crate::adam::Adam;
use crate::dataset::{Split, Window};
use crate::error::TrainerError;
use crate::network::{BatchGradients, Network};
use crate::parameters::Parameters;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::fmt;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Settings that determine the result of a training run on given data.
#[derive(clap::Args, Clone, Copy, Debug, PartialEq)]
pub(crate) struct Settings {
    /// Number of epochs. If `train --resume` states more than the checkpoint has, another cycle of
    /// the learning rate begins.
    #[arg(long, default_value_t = 12)]
    pub(crate) epochs: u32,
    /// Number of windows in a batch; each batch is one update of the parameters.
    #[arg(skip = 32_usize)]
    pub(crate) batch: usize,
    /// Largest learning rate.
    #[arg(long = "learning-rate", value_name = "LEARNING_RATE", default_value_t = 1e-3)]
    pub(crate) peak_rate: f64,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
}

impl fmt::Display for Settings {
    /// Writes all settings except the number of epochs, which may grow when a training run is
    /// resumed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { epochs: _, batch, peak_rate, seed } = self;
        write!(f, "batches of {batch} at a learning rate of {peak_rate} with seed {seed}")
    }
}

/// A one-cycle schedule of the learning rate: it rises to the peak, then falls to almost 0, both
/// along a cosine (Smith and Topin, arXiv 1708.07120; shape and ratios as in PyTorch's
/// `OneCycleLR`).
struct OneCycle {
    /// Largest learning rate, reached after 15 % of the updates.
    peak: f64,
    /// Number of updates of the whole cycle.
    updates: u64,
}

/// Fraction of a cycle's updates during which the learning rate rises to its peak.
const WARM_UP: f64 = 0.15;
/// Ratio of a cycle's peak learning rate to its first learning rate.
const RISE: f64 = 25.0;
/// Ratio of a cycle's first learning rate to its last.
const FALL: f64 = 1e4;

impl OneCycle {
    /// Returns the learning rate of update number `update` of the cycle, counted from 0.
    fn rate(&self, update: u64) -> f64 {
        let last = self.updates.saturating_sub(1).max(1) as f64;
        let peak_at = WARM_UP * last;
        let first = self.peak / RISE;
        let update = (update as f64).min(last);
        if update < peak_at {
            ease(first, self.peak, update / peak_at)
        } else {
            let part = (update - peak_at) / (last - peak_at);
            ease(self.peak, first / FALL, part)
        }
    }
}

/// Interpolates between `from` and `to` along half a cosine; `part` is in 0..=1.
fn ease(from: f64, to: f64, part: f64) -> f64 {
    to + (from - to) * (1.0 + (PI * part).cos()) / 2.0
}

/// State of a training run between two epochs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Training {
    pub(crate) settings: Settings,
    /// Number of finished epochs over all cycles.
    pub(crate) epoch: u32,
    /// Number of finished epochs when the current cycle of the learning rate began.
    pub(crate) cycle_start: u32,
    pub(crate) parameters: Parameters,
    pub(crate) adam: Adam,
    /// Candidate with the smallest validation error so far.
    pub(crate) best: Candidate,
    /// Errors of all finished epochs.
    pub(crate) curve: LearningCurve,
}

/// Errors before the first epoch and after each epoch, in units of `input.sd_uv` squared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LearningCurve {
    /// Mean squared error of the initial parameters on the validation windows.
    pub(crate) initial_validation: f64,
    /// Errors of each epoch, from epoch 1.
    pub(crate) epochs: Vec<EpochLosses>,
}

/// Errors of one epoch, in units of `input.sd_uv` squared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpochLosses {
    /// Mean training loss over the batches of the epoch.
    pub(crate) loss: f64,
    /// Mean squared error on the validation windows after the epoch.
    pub(crate) validation: f64,
}

/// Learning curve of a training run, with the chosen epoch and the error of PCA for comparison.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Learning {
    /// Errors of all epochs, including epochs before the checkpoint from which a run was resumed.
    pub(crate) curve: LearningCurve,
    /// Epoch with the smallest validation error; 0 for the initial parameters.
    pub(crate) best_epoch: u32,
    /// Mean squared error of PCA on the validation windows, in units of `input.sd_uv` squared.
    pub(crate) pca_validation: f64,
}

impl LearningCurve {
    /// Returns the validation errors of all epochs, starting with the initial parameters (epoch 0).
    pub(crate) fn validations(&self) -> impl Iterator<Item = f64> {
        let epochs = self.epochs.iter().map(|epoch| epoch.validation);
        std::iter::once(self.initial_validation).chain(epochs)
    }
}

/// Parameters after an epoch, with their validation error.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Candidate {
    /// Number of the epoch; 0 for the initial parameters.
    pub(crate) epoch: u32,
    /// Mean squared error on the validation windows, in units of `input.sd_uv` squared.
    pub(crate) validation: f64,
    pub(crate) parameters: Parameters,
}

impl Training {
    /// Creates a training run before its first epoch. The initial parameters are the first
    /// candidate for the best parameters.
    pub(crate) fn start(
        settings: Settings,
        parameters: Parameters,
        network: &Network,
        split: &Split,
    ) -> Self {
        let validation = network.mean_squared_error(&parameters, &validation_windows(split));
        let adam = Adam::new(&parameters);
        let best = Candidate { epoch: 0, validation, parameters: parameters.clone() };
        Self {
            settings,
            epoch: 0,
            cycle_start: 0,
            parameters,
            adam,
            best,
            curve: LearningCurve { initial_validation: validation, epochs: Vec::new() },
        }
    }

    /// Adds epochs to a finished training run: another cycle of the learning rate begins, and the
    /// optimiser keeps its state.
    pub(crate) fn extend(&mut self, epochs: u32) {
        self.cycle_start = self.settings.epochs;
        self.settings.epochs = epochs;
    }

    /// Returns whether all epochs are finished.
    pub(crate) fn is_done(&self) -> bool {
        self.epoch >= self.settings.epochs
    }

    /// Returns the number of batches of an epoch, at least 1. An epoch has as many windows as the
    /// training part has disjoint windows, rounded down to whole batches.
    pub(crate) fn batches(&self, split: &Split) -> usize {
        (split.training.disjoint_windows() / self.settings.batch).max(1)
    }

    /// Runs the next epoch over windows at random offsets, and returns its losses. `after_batch`
    /// receives the loss of each batch and may stop the epoch, which makes the training run
    /// unusable.
    ///
    /// The windows depend only on the seed and the epoch, so a resumed training run equals an
    /// uninterrupted run.
    ///
    /// # Errors
    /// If the loss or the validation error becomes infinite or NaN, or `after_batch` stops the
    /// epoch.
    pub(crate) fn run_epoch(
        &mut self,
        network: &Network,
        split: &Split,
        mut after_batch: impl FnMut(f64) -> ControlFlow<()>,
    ) -> Result<EpochLosses, TrainerError> {
        let epoch = self.epoch + 1;
        let batches = self.batches(split);
        let schedule = OneCycle {
            peak: self.settings.peak_rate,
            updates: u64::from(self.settings.epochs - self.cycle_start) * batches as u64,
        };
        let first_update = u64::from(self.cycle_start) * batches as u64;
        let mut rng = ChaCha8Rng::seed_from_u64(self.settings.seed);
        rng.set_stream(u64::MAX - u64::from(epoch));
        let windows = split.training.random(batches * self.settings.batch, &mut rng);
        let mut sum = 0.0;
        for batch in windows.chunks(self.settings.batch) {
            let BatchGradients { loss, gradients } = network.gradients(&mut self.parameters, batch);
            if !loss.is_finite() {
                return Err(TrainerError::Diverged(epoch, "loss", loss));
            }
            let rate = schedule.rate(self.adam.updates - first_update);
            self.adam.update(&mut self.parameters, &gradients, rate);
            sum += loss;
            if after_batch(loss).is_break() {
                return Err(TrainerError::Interrupted(self.epoch, PathBuf::new()));
            }
        }
        let validation = network.mean_squared_error(&self.parameters, &validation_windows(split));
        if !validation.is_finite() {
            let what = "validation error";
            return Err(TrainerError::Diverged(epoch, what, validation));
        }
        self.epoch = epoch;
        if validation < self.best.validation {
            self.best = Candidate { epoch, validation, parameters: self.parameters.clone() };
        }
        let loss = sum / batches as f64;
        let losses = EpochLosses { loss, validation };
        self.curve.epochs.push(losses);
        Ok(losses)
    }
}

/// Returns the windows of the validation part, without overlap: overlapping windows would slow down
/// every epoch.
pub(crate) fn validation_windows(split: &Split) -> Vec<&Window> {
    split.validation.aligned(split.validation.dimensions().steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Run;

    #[test]
    fn the_rate_rises_to_the_peak_and_falls_to_almost_zero() {
        let rates = |updates| {
            let schedule = OneCycle { peak: 1e-3, updates };
            let rates = (0..updates).map(|update| schedule.rate(update));
            rates.collect::<Vec<f64>>()
        };
        let of_101 = rates(101);
        for (update, rate) in [(0, 4e-5), (15, 1e-3), (100, 4e-9)] {
            assert!((of_101[update] - rate).abs() < 1e-12, "{update}");
        }
        assert!(of_101[..16].is_sorted());
        assert!(of_101[15..].is_sorted_by(|a, b| a >= b));
        assert!(rates(1)[0] > 0.0, "a training run of one update");
    }

    #[test]
    fn the_loss_falls_and_the_best_epoch_is_kept() {
        let run = Run::new();
        let mut training = run.start();
        let before = training.best.validation;
        let reports = [run.run_epoch(&mut training), run.run_epoch(&mut training)];
        assert!(training.is_done());
        assert!(reports[1].loss < reports[0].loss, "{reports:?}");
        let best = reports.iter().map(|report| report.validation).fold(before, f64::min);
        assert!(best < before, "{reports:?}, before {before}");
        assert!((training.best.validation - best).abs() < f64::EPSILON);
        let windows = validation_windows(&run.split);
        let best_parameters = &training.best.parameters;
        let measured = run.network.mean_squared_error(best_parameters, &windows);
        assert!((measured - best).abs() < f64::EPSILON);
    }

    #[test]
    fn a_training_is_reproducible_and_depends_on_the_seed() {
        let run = Run::new();
        let [mut first, mut second, mut other] = [run.start(), run.start(), run.start()];
        run.run_epoch(&mut first);
        run.run_epoch(&mut second);
        assert_eq!(first, second);
        other.settings.seed = 5;
        run.run_epoch(&mut other);
        assert_ne!(first.parameters, other.parameters);
    }
}
