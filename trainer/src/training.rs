//! Runs epochs and keeps the best parameters.

use crate::adam::Adam;
use crate::dataset::{Split, Window};
use crate::error::TrainerError;
use crate::learning_curve::{EpochLosses, LearningCurve};
use crate::network::{BatchGradients, Network};
use crate::parameters::Parameters;
use crate::progress::EpochReport;
use crate::schedule::OneCycle;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Settings that determine the result of a training run on given data.
#[derive(clap::Args, Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Number of epochs. With `train --resume`, more than the checkpoint's: another cycle of the
    /// learning rate begins.
    #[arg(long, default_value_t = 12)]
    pub epochs: u32,
    /// Number of windows in a batch; each batch is one update of the parameters.
    #[arg(skip = 32_usize)]
    pub batch: usize,
    /// Largest learning rate.
    #[arg(
        long = "learning-rate",
        value_name = "LEARNING_RATE",
        default_value_t = 1e-3
    )]
    pub peak_rate: f64,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// State of a training run between two epochs.
#[derive(Clone, Debug, PartialEq)]
pub struct Training {
    pub(crate) settings: Settings,
    /// Number of finished epochs.
    pub(crate) epoch: u32,
    /// Number of epochs that were finished when the present cycle of the learning rate began.
    pub(crate) cycle_start: u32,
    pub(crate) parameters: Parameters,
    pub(crate) adam: Adam,
    pub(crate) best: Candidate,
    pub(crate) curve: LearningCurve,
}

/// Parameters after an epoch, with their validation error.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Number of the epoch; 0 for the initial parameters.
    pub epoch: u32,
    /// Mean squared error on the validation windows, in units of `input.sd_uv` squared.
    pub validation: f64,
    /// Parameters of the network after this epoch.
    pub parameters: Parameters,
}

impl Training {
    /// Creates a training run before its first epoch; the initial parameters are the first
    /// candidate.
    pub fn start(
        settings: Settings,
        parameters: Parameters,
        network: &Network,
        split: &Split,
    ) -> Self {
        let validation = network.mean_squared_error(&parameters, &validation_windows(split));
        let adam = Adam::new(&parameters);
        let best = Candidate {
            epoch: 0,
            validation,
            parameters: parameters.clone(),
        };
        Self {
            settings,
            epoch: 0,
            cycle_start: 0,
            parameters,
            adam,
            best,
            curve: LearningCurve {
                initial_validation: validation,
                epochs: Vec::new(),
            },
        }
    }

    /// Returns the number of finished epochs.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Adds epochs to a finished training run: another cycle of the learning rate begins, and the
    /// optimiser keeps its state.
    pub(crate) fn extend(&mut self, epochs: u32) {
        self.cycle_start = self.settings.epochs;
        self.settings.epochs = epochs;
    }

    /// Returns the number of epochs of the training run.
    pub fn epochs(&self) -> u32 {
        self.settings.epochs
    }

    /// Returns whether all epochs are finished.
    pub fn is_done(&self) -> bool {
        self.epoch >= self.settings.epochs
    }

    /// Returns the candidate with the smallest validation error so far.
    pub fn best(&self) -> &Candidate {
        &self.best
    }

    /// Returns the errors of all finished epochs.
    pub fn curve(&self) -> &LearningCurve {
        &self.curve
    }

    /// Returns the number of batches of an epoch, at least 1. An epoch has as many windows as the
    /// training part has disjoint windows, rounded down to whole batches.
    pub fn batches(&self, split: &Split) -> usize {
        (split.training.disjoint_windows() / self.settings.batch).max(1)
    }

    /// Runs the next epoch over windows at random offsets; `after_batch` receives the loss of each
    /// batch, and may stop the epoch, which then leaves the training run unusable.
    ///
    /// The order of the windows depends only on the seed and the epoch, so that a resumed training
    /// run equals an uninterrupted one.
    ///
    /// # Errors
    /// If the loss becomes infinite or NaN, or `after_batch` stops the epoch.
    pub fn run_epoch(
        &mut self,
        network: &Network,
        split: &Split,
        mut after_batch: impl FnMut(f64) -> ControlFlow<()>,
    ) -> Result<EpochReport, TrainerError> {
        let epoch = self.epoch + 1;
        let batches = self.batches(split);
        let schedule = OneCycle {
            peak: self.settings.peak_rate,
            updates: u64::from(self.settings.epochs - self.cycle_start) * batches as u64,
        };
        let first_update = u64::from(self.cycle_start) * batches as u64;
        let mut rng = ChaCha8Rng::seed_from_u64(self.settings.seed);
        rng.set_stream(u64::MAX - u64::from(epoch));
        let windows = split
            .training
            .random(batches * self.settings.batch, &mut rng);
        let mut sum = 0.0;
        for batch in windows.chunks(self.settings.batch) {
            let BatchGradients { loss, gradients } = network.gradients(&mut self.parameters, batch);
            if !loss.is_finite() {
                return Err(TrainerError::Diverged(epoch, loss));
            }
            let rate = schedule.rate(self.adam.updates() - first_update);
            self.adam.update(&mut self.parameters, &gradients, rate);
            sum += loss;
            if after_batch(loss).is_break() {
                return Err(TrainerError::Interrupted(self.epoch, PathBuf::new()));
            }
        }
        let validation = network.mean_squared_error(&self.parameters, &validation_windows(split));
        self.epoch = epoch;
        if validation < self.best.validation {
            self.best = Candidate {
                epoch,
                validation,
                parameters: self.parameters.clone(),
            };
        }
        let loss = sum / batches as f64;
        self.curve.epochs.push(EpochLosses { loss, validation });
        Ok(EpochReport {
            epoch,
            loss,
            validation,
        })
    }
}

/// Returns disjoint windows of the validation part; overlapping windows would slow down every
/// epoch.
pub(crate) fn validation_windows(split: &Split) -> Vec<&Window> {
    split
        .validation
        .aligned(split.validation.dimensions().steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{self, Run};

    #[test]
    fn epoch_0_has_the_error_of_the_projection_onto_the_directions() {
        let run = Run::new();
        let windows = validation_windows(&run.split);
        let directions = testing::directions();
        let mut sum = 0.0;
        for window in &windows {
            // The directions are orthonormal, so the error is the energy outside their span.
            let energy = |values: &[f32]| values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
            let code: Vec<f32> = directions
                .iter()
                .map(|direction| direction.iter().zip(*window).map(|(d, x)| d * x).sum())
                .collect();
            sum += energy(&window[..]) - energy(&code);
        }
        let expected = sum / (windows.len() * windows[0].len()) as f64;
        let training = run.start();
        assert!((training.best().validation - expected).abs() < 1e-6 * expected);
        assert_eq!(training.best().epoch, 0);
    }

    #[test]
    fn the_loss_falls_and_the_best_epoch_is_kept() {
        let run = Run::new();
        let mut training = run.start();
        let before = training.best().validation;
        let reports = [run.run_epoch(&mut training), run.run_epoch(&mut training)];
        assert!(training.is_done());
        assert!(reports[1].loss < reports[0].loss, "{reports:?}");
        let best = reports
            .iter()
            .map(|report| report.validation)
            .fold(before, f64::min);
        assert!(best < before, "{reports:?}, before {before}");
        assert!((training.best().validation - best).abs() < f64::EPSILON);
        let windows = validation_windows(&run.split);
        let best_parameters = &training.best().parameters;
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
