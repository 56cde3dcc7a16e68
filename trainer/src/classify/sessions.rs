//! Recordings with the trials in them.

use super::fit::Plan;
use crate::error::TrainerError;
use crate::progress::ProgressObserver;
use crate::selection::file_name;
use artifact::Description;
use artifact::classifier::Class;
use nalgebra::DMatrix;
use packed_fit::{FitError, Track};
use recordings::Recording;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A recording and its trials.
pub(super) struct Session {
    /// The recording, cut to begin where a hop begins on a device.
    pub(super) track: Track,
    /// Trials in chronological order.
    pub(super) trials: Vec<Trial>,
}

/// A trial that lies within its recording.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    /// Index of the trial's class.
    pub(super) class: usize,
    /// Parts of the trial over which a decision can average, in the order of time; the last part
    /// ends with the trial.
    pub(super) windows: Vec<Window>,
}

/// Part of a trial.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Range of hops, counted from the start of the session.
    pub(super) hops: std::ops::Range<usize>,
    /// Second moment of the band-passed electrodes, uV^2.
    pub(super) moment: DMatrix<f64>,
}

impl Session {
    /// Finds the trials in a track. `events` are times since the track's first step, in seconds,
    /// with their classes. Trials that extend beyond the track are left out.
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

    /// Returns the trials, each with its session.
    pub(super) fn with_trials(&self) -> impl Iterator<Item = (&Self, &Trial)> {
        self.trials.iter().map(move |trial| (self, trial))
    }
}

/// Position of a session's first step in its track and in its recording.
#[derive(Clone, Copy)]
pub(super) struct Start {
    /// Number of steps that are cut off the start of a track, so that the track begins where a hop
    /// begins on a device.
    pub(super) skipped: usize,
    /// Time in the recording that the first step of the first hop represents, seconds.
    pub(super) seconds: f64,
}

impl Start {
    /// Returns where sessions start in tracks from which the settling time of the filters has been
    /// removed.
    pub(super) fn new(
        description: &Description,
        mains_hz: u32,
        plan: &Plan,
    ) -> Result<Self, TrainerError> {
        let settling = packed_fit::settling_steps(description, mains_hz)?;
        let delay_us = model_gen::group_delay_us(description, mains_hz)?;
        let first = settling.next_multiple_of(plan.hop());
        Ok(Self {
            skipped: first - settling,
            seconds: first as f64 / plan.step_rate_hz() - f64::from(delay_us) * 1e-6,
        })
    }

    /// Returns the track without its first `skipped` steps.
    pub(super) fn cut(self, track: &Track) -> Track {
        track.part(self.skipped.min(track.steps())..track.steps())
    }
}

/// Times of events since the start of a session, in seconds, and their classes.
pub(super) type Events = Vec<(f64, usize)>;

/// Reads the events of recordings.
///
/// # Errors
/// If a recording cannot be read, or no recording has an event of one of the classes. `option` is
/// the command-line option that named the recordings, for the error message.
pub(super) fn read_events(
    files: &[PathBuf],
    start: Start,
    plan: &Plan,
    option: &'static str,
) -> Result<Vec<Events>, TrainerError> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut all = Vec::new();
    for file in files {
        let unreadable = |source| FitError::Recording(file_name(file), source);
        let mut recording = Recording::open(file).map_err(unreadable)?;
        let onsets = recording.onsets().map_err(unreadable)?;
        let mut events = Vec::new();
        for (seconds, label) in onsets.seconds.iter().zip(&onsets.labels) {
            let label = label.name();
            let class = plan.classes().iter().position(|class| class.event == label);
            events.extend(class.map(|class| (seconds - start.seconds, class)));
            *counts.entry(label).or_default() += 1;
        }
        all.push(events);
    }
    let is_missing = |class: &&Class| !counts.contains_key(&class.event);
    match plan.classes().iter().find(is_missing) {
        Some(class) => Err(TrainerError::NoSuchEvent {
            files: option,
            event: class.event.clone(),
            found: counts.into_iter().collect(),
        }),
        None => Ok(all),
    }
}

/// Finds the trials of recordings in their tracks.
///
/// # Errors
/// If [`read_events`] fails.
pub(super) fn read(
    files: &[PathBuf],
    tracks: &[Track],
    start: Start,
    plan: &Plan,
    option: &'static str,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<Session>, TrainerError> {
    let mut sessions = Vec::new();
    for (events, track) in read_events(files, start, plan, option)?.iter().zip(tracks) {
        let session = Session::new(start.cut(track), events, plan);
        let outside = events.len() - session.trials.len();
        if outside > 0 {
            observer.message(&format!(
                "{}: trials left out: {outside}, which start while the filters settle, in the \
                 first {:.1} s, or end after the recording",
                session.track.name, start.seconds
            ));
        }
        sessions.push(session);
    }
    Ok(sessions)
}
