//! Recordings with the trials in them.

use super::fit::Plan;
use crate::error::TrainerError;
use crate::progress::ProgressObserver;
use nalgebra::DMatrix;
use packed_fit::{FitError, Track};
use recordings::Recording;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A recording and its trials.
pub(super) struct Session {
    /// The recording from the start of a device's hop on.
    pub(super) track: Track,
    /// Trials in the order of time.
    pub(super) trials: Vec<Trial>,
}

/// A trial that lies within its recording.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    /// Index of its class.
    pub(super) class: usize,
    /// Parts of the trial over each of which a decision can average, in the order of time; the last
    /// one ends with the trial.
    pub(super) windows: Vec<Window>,
}

/// Part of a trial.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Hops from the start of the session.
    pub(super) hops: std::ops::Range<usize>,
    /// Second moment of the band-passed electrodes, uV^2.
    pub(super) moment: DMatrix<f64>,
}

impl Session {
    /// Finds the trials in a track; `events` are their times since its first step, in seconds, and
    /// their classes. Trials that are not within the track are left out.
    pub(super) fn new(track: Track, events: &[(f64, usize)], plan: &Plan) -> Self {
        let band_passed = plan.band_passed(&track);
        let hops = track.steps() / plan.hop();
        let trial = |&(seconds, class): &(f64, usize)| {
            let windows = plan.windows(seconds, hops)?.into_iter().map(|hops| {
                let steps = hops.start * plan.hop()..hops.end * plan.hop();
                let part = band_passed.columns_range(steps);
                let moment = part * part.transpose() / part.ncols() as f64;
                Window { hops, moment }
            });
            let windows = windows.collect();
            Some(Trial { class, windows })
        };
        let trials = events.iter().filter_map(trial).collect();
        Self { track, trials }
    }
}

/// Reads the events of recordings, and finds the trials in their tracks. `start_step` is the number
/// of steps that a track lacks at its start; its first step shows the electrodes at `start_s`.
///
/// # Errors
/// If a recording cannot be read, or no recording has an event of a class; `option` names them.
pub(super) fn read(
    files: &[PathBuf],
    tracks: Vec<Track>,
    (start_step, start_s): (usize, f64),
    plan: &Plan,
    option: &'static str,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<Session>, TrainerError> {
    // Hops start where those of a device do.
    let skipped = start_step.next_multiple_of(plan.hop()) - start_step;
    let start_s = start_s + skipped as f64 / plan.step_rate_hz();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut sessions = Vec::new();
    for (file, track) in files.iter().zip(tracks) {
        let unreadable = |source| FitError::Recording(track.name.clone(), source);
        let mut recording = Recording::open(file).map_err(unreadable)?;
        let onsets = recording.onsets().map_err(unreadable)?;
        let track = track.part(skipped.min(track.steps())..track.steps());
        let mut events = Vec::new();
        for (seconds, label) in onsets.seconds.iter().zip(&onsets.labels) {
            let label = label.name();
            let class = plan.classes().iter().position(|class| class.event == label);
            events.extend(class.map(|class| (seconds - start_s, class)));
            *counts.entry(label).or_default() += 1;
        }
        let session = Session::new(track, &events, plan);
        let outside = events.len() - session.trials.len();
        if outside > 0 {
            observer.message(&format!(
                "{}: trials left out: {outside}, which start while the filters settle, in the \
                 first {start_s:.1} s, or end after the recording",
                session.track.name
            ));
        }
        sessions.push(session);
    }
    match plan
        .classes()
        .iter()
        .find(|class| !counts.contains_key(&class.event))
    {
        Some(class) => Err(TrainerError::NoSuchEvent {
            files: option,
            event: class.event.clone(),
            found: counts.into_iter().collect(),
        }),
        None => Ok(sessions),
    }
}
