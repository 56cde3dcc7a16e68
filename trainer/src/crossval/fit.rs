//! Trains and tests the model of a fold.

use super::outcome::{Outcome, Validation};
use super::plan::{Block, Fold};
use crate::calibrate::calibrated_artifact;
use crate::dataset::{Dataset, TrainingSet};
use crate::error::TrainerError;
use crate::evaluate::{ReconstructionError, evaluate};
use crate::network::Network;
use crate::parameters::Parameters;
use crate::progress::ProgressObserver;
use crate::training::{Settings, Training, validation_windows};
use artifact::{Description, Geometry, Mode};
use packed_fit::Track;
use std::ops::ControlFlow;

/// The data for training and testing a fold's model.
pub(super) struct Data {
    /// Recordings to train on, scaled so that every person has the same signal power.
    pub(super) training: Vec<Track>,
    /// The training recordings with their original amplitude, for the ranges of input and codes.
    pub(super) recorded: Vec<Track>,
    pub(super) test: Vec<Track>,
}

impl Data {
    /// Returns the blocks outside a fold for training, and the blocks of the fold for testing.
    /// `tracks` are all recordings of the subject.
    pub(super) fn of_fold(tracks: &[Track], fold: &Fold, gap: usize) -> Self {
        let training = parts(tracks, fold, gap, false);
        Self { recorded: training.clone(), training, test: parts(tracks, fold, gap, true) }
    }
}

/// Trains and tests a model, and returns the outcome of the fold.
pub(super) fn test_fold(
    data: &Data,
    fold: &Fold,
    description: &Description,
    settings: Settings,
    observer: &mut impl ProgressObserver,
) -> Result<Outcome, TrainerError> {
    let mut description = description.clone();
    let dimensions = description.dimensions();
    let training_set = TrainingSet::new(&data.training, &data.recorded, dimensions)?;
    let TrainingSet { split, whole, sd_uv } = &training_set;
    let mut test = Dataset::from_tracks(&data.test, dimensions)?;
    test.scale(1.0 / sd_uv);
    description.input.sd_uv = *sd_uv;
    let geometry = Geometry::new(&description);
    let network = Network::new(&description);
    let directions = training_set.directions();
    let settings = Settings { seed: seed(settings.seed, fold), ..settings };
    let initial = |mode| Parameters::initial(mode, geometry, &directions, settings.seed);
    let linear = initial(Mode::Pca);
    let pca_validation = network.mean_squared_error(&linear, &validation_windows(split));
    let (best, best_epoch, model_validation, curve) = match description.mode {
        Mode::Pca => (linear.clone(), 0, pca_validation, None),
        mode => {
            let start = initial(mode);
            let mut training = Training::start(settings, start, &network, split);
            while !training.is_done() {
                let go_on = |_| ControlFlow::Continue(());
                let losses = training.run_epoch(&network, split, go_on)?;
                observer.epoch_finished(training.epoch, losses);
            }
            let best = training.best;
            let curve = Some(training.curve);
            (best.parameters, best.epoch, best.validation, curve)
        }
    };
    let pca = calibrated_artifact(description.clone(), &linear, whole)?;
    let pca = evaluate(&pca, &test)?;
    let windows = test.aligned(description.window.hop).len();
    let model = if description.mode == Mode::Paper {
        // Integer codes of mode `paper` have no decoder, so test the float network, whose decoder
        // gets the positions of the pools' maxima.
        let [mse, signal] = network.errors(&best, &test.aligned(description.window.hop));
        let error = ReconstructionError {
            mse,
            mse_uv2: mse * sd_uv.powi(2),
            prd_percent: 100.0 * (mse / signal).sqrt(),
        };
        [Some(error), None]
    } else {
        let model = calibrated_artifact(description.clone(), &best, whole)?;
        let evaluation = evaluate(&model, &test)?;
        [Some(evaluation.float), Some(evaluation.integer)]
    };
    Ok(Outcome {
        settings: String::new(),
        subject: fold.subject.clone(),
        repetition: fold.repetition,
        fold: fold.number,
        mode: description.mode.to_string(),
        numbers: dimensions.numbers,
        is_decodable: description.mode != Mode::Paper,
        tested_on: fold.tested_on(),
        windows,
        sd_uv: *sd_uv,
        best_epoch,
        validation: Validation { model: model_validation, pca: pca_validation },
        curve,
        model_float: model[0],
        model_integer: model[1],
        pca_float: pca.float,
        pca_integer: pca.integer,
    })
}

/// Returns the seed of a fold's training run; each fold and repetition has a different seed.
fn seed(first: u64, fold: &Fold) -> u64 {
    first
        .wrapping_mul(1_000)
        .wrapping_add(100 * fold.repetition as u64)
        .wrapping_add(fold.number as u64)
}

/// Returns the contiguous parts of the tracks that the fold tests on or, if `is_test` is false,
/// trains on. A part lacks its first `gap` steps unless it is at the start of its recording, so
/// that no training window overlaps a test window.
fn parts(tracks: &[Track], fold: &Fold, gap: usize, is_test: bool) -> Vec<Track> {
    let mut parts = Vec::new();
    for (recording, track) in tracks.iter().enumerate() {
        let steps = track.steps();
        let start_of = |block: usize| block * steps / fold.blocks;
        let belongs = |block: usize| fold.test.contains(&Block { recording, block }) == is_test;
        let mut block = 0;
        while block < fold.blocks {
            let first = block;
            while block < fold.blocks && belongs(block) {
                block += 1;
            }
            if block > first {
                let start = start_of(first) + if first > 0 { gap } else { 0 };
                let end = start_of(block).max(start);
                parts.push(track.part(start..end));
            }
            block += 1;
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a track in which each value is 1000 times the recording's index plus the step's
    /// index.
    fn track(recording: usize, steps: usize) -> Track {
        let values = (0..steps).map(|step| (1000 * recording + step) as f32);
        Track::new(&format!("run{recording}"), 1, values.collect())
    }

    fn fold(blocks: usize, test: &[(usize, usize)]) -> Fold {
        Fold {
            subject: "s".to_owned(),
            repetition: 1,
            number: 1,
            blocks,
            test: test.iter().map(|&(recording, block)| Block { recording, block }).collect(),
            recordings: vec!["run0".to_owned(), "run1".to_owned()],
            trained_on: 2 * blocks - test.len(),
        }
    }

    fn ends(parts: &[Track]) -> Vec<(f32, f32)> {
        let end = |track: &Track| (track.values[0], track.values[track.values.len() - 1]);
        parts.iter().map(end).collect()
    }

    #[test]
    fn whole_runs_are_tested_or_trained_on() {
        let tracks = [track(0, 100), track(1, 50)];
        let fold = fold(1, &[(1, 0)]);
        assert_eq!(ends(&parts(&tracks, &fold, 16, true)), [(1000.0, 1049.0)]);
        assert_eq!(ends(&parts(&tracks, &fold, 16, false)), [(0.0, 99.0)]);
    }

    #[test]
    fn neighbouring_blocks_are_united_and_a_window_is_left_out_where_test_and_training_meet() {
        let tracks = [track(0, 400)];
        let fold = fold(4, &[(0, 1)]);
        assert_eq!(ends(&parts(&tracks, &fold, 16, true)), [(116.0, 199.0)]);
        let training = parts(&tracks, &fold, 16, false);
        assert_eq!(ends(&training), [(0.0, 99.0), (216.0, 399.0)]);
    }
}
