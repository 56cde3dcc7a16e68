//! Measures classifiers on trials that they were not trained on.

use super::figures::{Decided, Part, figures};
use super::fit::{Fitted, Plan, fit};
use super::sessions::{Session, Trial};
use crate::error::TrainerError;
use artifact::classifier::{ClassifierFigures, Decision, Prediction};
use packed_fit::{features, in_parallel};
use std::ops::Range;

/// Number of blocks into which the trials of a single recording are divided.
const BLOCKS: usize = 5;
/// Time that a [`Course`] covers before the event and after the end of the trial, seconds.
const AROUND_S: f64 = 2.0;

/// Mean probability of a class over the trials of this class, as a function of the time since the
/// event: pairs (seconds, probability).
pub(crate) type Course = Vec<(f64, f64)>;

/// Trials that are left out together.
pub(super) struct Fold {
    name: String,
    session: usize,
    trials: Range<usize>,
}

/// Returns the folds of a cross-validation: the recordings or, for a single recording, contiguous
/// blocks of its trials.
pub(super) fn folds(sessions: &[Session]) -> Vec<Fold> {
    if let [session] = sessions {
        let count = session.trials.len();
        let block = |index: usize| Fold {
            name: format!("block {} of {BLOCKS}", index + 1),
            session: 0,
            trials: index * count / BLOCKS..(index + 1) * count / BLOCKS,
        };
        return (0..BLOCKS).map(block).collect();
    }
    let folds = sessions.iter().enumerate().map(|(index, session)| Fold {
        name: session.track.name.clone(),
        session: index,
        trials: 0..session.trials.len(),
    });
    folds.collect()
}

/// Returns the figures of a cross-validation, and for each class the course of its probability.
///
/// # Errors
/// If [`fit`] fails for a fold.
pub(super) fn cross_validate(
    plan: &Plan,
    sessions: &[Session],
    folds: &[Fold],
) -> Result<(ClassifierFigures, Vec<Course>), TrainerError> {
    let around = hops_around(plan);
    let parts = in_parallel::map(folds, |fold| {
        let training = sessions.iter().enumerate().flat_map(|(index, session)| {
            let trials = session.trials.iter().enumerate();
            let kept = trials
                .filter(move |(trial, _)| index != fold.session || !fold.trials.contains(trial));
            kept.map(move |(_, trial)| (session, trial))
        });
        let fitted = fit(plan, &training.collect::<Vec<_>>())?;
        let session = &sessions[fold.session];
        let trials = &session.trials[fold.trials.clone()];
        let predictions = predictions(&fitted, session);
        let part = decide(&fitted, &fold.name, trials, &predictions);
        Ok((part, courses(plan, trials, &predictions, around)))
    });
    let parts = parts.into_iter().collect::<Result<Vec<_>, TrainerError>>()?;
    let (parts, courses): (Vec<Part>, Vec<_>) = parts.into_iter().unzip();
    let courses = (0..plan.classes().len()).map(|class| {
        let all = courses.iter().flat_map(|courses| &courses[class]);
        mean_course(plan, &all.collect::<Vec<_>>(), around)
    });
    Ok((figures(&parts, plan.classes().len()), courses.collect()))
}

/// Returns the decisions of a classifier on all trials of recordings.
pub(super) fn decide_sessions(fitted: &Fitted, sessions: &[Session]) -> Vec<Part> {
    let parts = sessions.iter().map(|session| {
        let predictions = predictions(fitted, session);
        decide(fitted, &session.track.name, &session.trials, &predictions)
    });
    parts.collect()
}

/// Returns the host's decision at each hop of a recording.
fn predictions(fitted: &Fitted, session: &Session) -> Vec<Prediction> {
    let mut decision = Decision::new(&fitted.classifier);
    let levels = features::levels(&session.track, &fitted.classifier);
    levels.iter().map(|levels| decision.add_hop(levels)).collect()
}

/// Returns the decision at the last hop of each trial.
fn decide(fitted: &Fitted, name: &str, trials: &[Trial], predictions: &[Prediction]) -> Part {
    let decided = trials.iter().map(|trial| {
        let prediction = &predictions[last_hop(trial)];
        let scores =
            (prediction.probabilities.iter()).map(|&p| f64::from(p).max(f64::MIN_POSITIVE).ln());
        Decided {
            class: trial.class,
            decision: prediction.class(),
            scores: scores.collect(),
            float_scores: fitted.float_scores(trial),
        }
    });
    Part { name: name.to_owned(), decided: decided.collect() }
}

/// Returns the index of a trial's last hop, counted from the start of the session.
fn last_hop(trial: &Trial) -> usize {
    trial.windows.last().map_or(0, |window| window.hops.end - 1)
}

/// Returns for each class, and each of its trials, the probability of this class at the hops that a
/// course covers; `None` for hops outside the recording.
fn courses(
    plan: &Plan,
    trials: &[Trial],
    predictions: &[Prediction],
    [before, after]: [usize; 2],
) -> Vec<Vec<Vec<Option<f32>>>> {
    let mut courses = vec![Vec::new(); plan.classes().len()];
    for trial in trials {
        let hops = (0..before + 1 + after).map(|hop| {
            let hop = (last_hop(trial) + hop).checked_sub(before)?;
            Some(predictions.get(hop)?.probabilities[trial.class])
        });
        courses[trial.class].push(hops.collect());
    }
    courses
}

/// Returns the mean over trials of the probabilities that [`courses`] returns.
fn mean_course(plan: &Plan, trials: &[&Vec<Option<f32>>], [before, after]: [usize; 2]) -> Course {
    let mean = |hop: usize| {
        let values = trials.iter().filter_map(|trial| trial[hop]);
        let (sum, count) =
            values.fold((0.0, 0.0), |(sum, count), p| (sum + f64::from(p), count + 1.0));
        let seconds = plan.end_s() + (hop as f64 - before as f64) * plan.hop_s();
        (seconds, sum / count)
    };
    (0..before + 1 + after).map(mean).collect()
}

/// Returns the numbers of hops that a course covers before and after the last hop of a trial.
fn hops_around(plan: &Plan) -> [usize; 2] {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some hundreds")]
    let hops = |seconds: f64| (seconds.max(0.0) / plan.hop_s()).round() as usize;
    [plan.end_s() + AROUND_S, AROUND_S].map(hops)
}
