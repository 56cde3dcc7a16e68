//! Trains on the blocks outside a fold, and tests on the fold.

use super::outcome::{Outcome, Validation};
use super::plan::{Block, Fold};
use crate::calibrate::calibrated_artifact;
use crate::dataset::Dataset;
use crate::error::TrainerError;
use crate::evaluate::{ReconstructionError, evaluate};
use crate::network::Network;
use crate::parameters::Parameters;
use crate::pca;
use crate::progress::ProgressObserver;
use crate::track::Track;
use crate::training::{Settings, Training};
use artifact::{Description, Geometry, Mode};
use std::ops::ControlFlow;

/// Returns the outcome of a fold, from the tracks of its subject.
pub(super) fn test_fold(
    tracks: &[Track],
    fold: &Fold,
    description: &Description,
    settings: Settings,
    observer: &mut impl ProgressObserver,
) -> Result<Outcome, TrainerError> {
    let mut description = description.clone();
    let dimensions = description.dimensions();
    let training = parts(tracks, fold, dimensions.steps, false);
    let mut split = Dataset::split(&training, dimensions)?;
    let mut whole = Dataset::from_tracks(&training, dimensions)?;
    let mut test = Dataset::from_tracks(&parts(tracks, fold, dimensions.steps, true), dimensions)?;
    let sd_uv = split.training.deviation();
    if sd_uv <= 0.0 {
        return Err(TrainerError::Silent);
    }
    for part in [
        &mut split.training,
        &mut split.validation,
        &mut whole,
        &mut test,
    ] {
        part.scale(1.0 / sd_uv);
    }
    description.input.sd_uv = sd_uv;
    let geometry = Geometry::new(&description);
    let network = Network::new(&description);
    let moment = pca::second_moment(&split.training);
    let directions = pca::principal_directions(moment, dimensions.numbers);
    let linear = Parameters::pca(geometry, &directions);
    let validation = split.validation.aligned(dimensions.steps);
    let pca_validation = network.mean_squared_error(&linear, &validation);
    let settings = Settings {
        seed: seed(settings.seed, fold),
        ..settings
    };
    let (best, best_epoch, model_validation, curve) = match description.mode {
        Mode::Pca => (linear.clone(), 0, pca_validation, None),
        mode => {
            let start = Parameters::initial(mode, geometry, &directions, settings.seed);
            let mut training = Training::start(settings, start, &network, &split);
            while !training.is_done() {
                let go_on = |_| ControlFlow::Continue(());
                observer.epoch_finished(training.run_epoch(&network, &split, go_on)?);
            }
            let best = training.best();
            let curve = Some(training.curve().clone());
            (best.parameters.clone(), best.epoch, best.validation, curve)
        }
    };
    let pca = calibrated_artifact(description.clone(), &linear, &whole)?;
    let pca = evaluate(&pca, &test)?;
    let windows = test.aligned(description.window.hop).len();
    let model = if description.mode == Mode::Paper {
        // Its integer codes have no decoder, so the test is that of the float network with the
        // pools' places.
        let [mse, signal] = network.errors(&best, &test.aligned(description.window.hop));
        let error = ReconstructionError {
            mse,
            mse_uv2: mse * sd_uv.powi(2),
            prd_percent: 100.0 * (mse / signal).sqrt(),
        };
        [Some(error), None]
    } else {
        let evaluation = evaluate(
            &calibrated_artifact(description.clone(), &best, &whole)?,
            &test,
        )?;
        [Some(evaluation.float), Some(evaluation.integer)]
    };
    Ok(Outcome {
        settings: String::new(),
        subject: fold.subject.clone(),
        repetition: fold.repetition,
        fold: fold.fold,
        mode: description.mode.to_string(),
        numbers: dimensions.numbers,
        is_decodable: description.mode != Mode::Paper,
        tested_on: fold.tested_on(),
        windows,
        sd_uv,
        best_epoch,
        validation: Validation {
            model: model_validation,
            pca: pca_validation,
        },
        curve,
        model_float: model[0],
        model_integer: model[1],
        pca_float: pca.float,
        pca_integer: pca.integer,
    })
}

/// Returns the seed of a fold, so that repetitions start with other parameters.
fn seed(first: u64, fold: &Fold) -> u64 {
    first
        .wrapping_mul(1_000)
        .wrapping_add(100 * fold.repetition as u64)
        .wrapping_add(fold.fold as u64)
}

/// Returns the contiguous parts of the tracks that belong to the test, or those that do not. The
/// first `gap` steps of a part that continues another are left out, so that no window of one
/// overlaps one of the other.
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
    use crate::testing;

    /// Returns a track whose values are 1000 times the recording plus the step.
    fn track(recording: usize, steps: usize) -> Track {
        let values = (0..steps).map(|step| (1000 * recording + step) as f32);
        testing::track(&format!("run{recording}"), 1, values.collect())
    }

    fn fold(blocks: usize, test: &[(usize, usize)]) -> Fold {
        Fold {
            subject: "s".to_owned(),
            repetition: 1,
            fold: 1,
            blocks,
            test: test
                .iter()
                .map(|&(recording, block)| Block { recording, block })
                .collect(),
            recordings: vec!["run0".to_owned(), "run1".to_owned()],
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
