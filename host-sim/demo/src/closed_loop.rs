//! A closed loop on this machine: a recording with cues, a virtual board, the bridge, and a
//! classifier's decision for each hop.
//!
//! ```text
//! recording ─┬─ host-sim ─── PTY ─── corticode-bridge ─── JSON lines ─┬─ Outcome ─ pictures
//!            └─ virtual ADC ─ pipeline ─ Decision (offline integers) ─┘
//! ```

mod cued_recording;
mod offline;
mod pictures;
mod playback;

use std::fmt;
use std::path::{Path, PathBuf};

use artifact::classifier::Classifier;
use pipeline::Mains;

pub use offline::{Prediction, features, predictions};
pub use playback::Received;

use crate::program::{BOARD, BRIDGE, Program, TRAINER};
use crate::{Failure, in_a_folder, progress, require};
use offline::Reference;

/// What to play, and how.
#[derive(Debug, Clone)]
pub struct Options {
    /// Paths of a recording whose events are the cues, and of a classifier from `trainer classify`.
    /// If `None`, three recordings of synthetic EEG are made from the seed, a classifier is fitted
    /// to two of them, and the third is played.
    pub own: Option<[PathBuf; 2]>,
    /// Mains frequency that the device's notch removes.
    pub mains: Mains,
    /// Seed of the synthetic EEG.
    pub seed: u64,
    /// Whether the recording is played as fast as board and bridge can, instead of in real time;
    /// latencies are then not measured.
    pub fast: bool,
}

/// A cue of the recording, and the class that was decided for it.
#[derive(Debug, Clone, Copy)]
pub struct Trial {
    /// Index of the class that the cue asks for.
    pub class: usize,
    /// Time of the cue since the recording's start, seconds.
    pub cue_s: f64,
    /// Number of the hop, from 1, with which the trial ends.
    hop: usize,
    /// Index of the class that was decided at the end of the trial. `None` if nothing was decided:
    /// the filters had not settled, the signals were not usable, or the recording ended before the
    /// trial did.
    pub decision: Option<usize>,
}

/// Results of a closed loop.
#[derive(Debug)]
pub struct Outcome {
    /// Classifier that made the decisions.
    pub classifier: Classifier,
    /// File name of the recording.
    recording: String,
    is_fast: bool,
    /// All cues, in the order of time.
    pub trials: Vec<Trial>,
    /// All predictions that arrived, in the order of their arrival.
    pub received: Vec<Received>,
    /// Number of hops in the recording.
    pub hops: usize,
    /// Number of predictions that equal, bit for bit, the predictions of the offline integer
    /// pipeline.
    pub equal: usize,
}

/// Runs a closed loop with the programs in the folder `programs`. Draws the results into the folder
/// `pictures`, unless that is `None`.
///
/// # Errors
/// A file cannot be used or written, or a program does not start, fails or does not respond in
/// time.
pub fn run(
    options: &Options,
    programs: &Path,
    pictures: Option<&Path>,
) -> Result<Outcome, Failure> {
    require(programs, &[BOARD, BRIDGE, TRAINER], "cargo loop")?;
    let outcome = in_a_folder(async |folder| {
        let [recording, classifier] = match &options.own {
            Some(own) => own.clone(),
            None => fitted(options, programs, folder).await?,
        };
        play([&recording, &classifier], options, [programs, folder]).await
    })?;
    if let Some(folder) = pictures {
        pictures::draw(&outcome, folder)?;
    }
    Ok(outcome)
}

/// Makes recordings, and fits a classifier to all but the last one. Returns the last recording and
/// the classifier.
async fn fitted(
    options: &Options,
    programs: &Path,
    folder: &Path,
) -> Result<[PathBuf; 2], Failure> {
    let [.., recording] = cued_recording::write(folder, options.mains, options.seed)?;
    let classifier = folder.join("classifier.toml");
    let [train, out] = [folder, &classifier].map(|path| path.display().to_string());
    let model = crate::pictures::MODEL;
    #[rustfmt::skip]
    let arguments = [
        "classify", "--artifact", model, "--data", &train, "--train", "run1,run2",
        "--mains", mains_hz(options.mains), "--events", cued_recording::EVENTS,
        "--trial", cued_recording::TRIAL, "--out", &out,
    ];
    let mut trainer = Program::start(&programs.join(TRAINER), &arguments, folder, None)?;
    match trainer.child.wait().await {
        Ok(status) if status.success() => Ok([recording, classifier]),
        _ => Err(trainer.ended()),
    }
}

async fn play(own: [&Path; 2], options: &Options, folders: [&Path; 2]) -> Result<Outcome, Failure> {
    let [recording, classifier] = own;
    let classifier = Classifier::read(classifier);
    let next = "`trainer classify` writes one; docs/closed-loop.md has the steps";
    let classifier = classifier.map_err(|error| Failure::check("the classifier", error, next))?;
    let reference = Reference::new(recording, &classifier, options.mains)?;
    let hops = reference.predictions.len();
    let bar = progress::bar(hops as u64);
    let received = playback::play(own, options, folders, &bar).await?;
    bar.finish_and_clear();
    let mut trials = reference.trials;
    for trial in &mut trials {
        let last = received.iter().rfind(|received| received.hop == trial.hop);
        trial.decision = last.and_then(|received| received.prediction.class);
    }
    let is_equal = |received: &&Received| {
        let place = received.hop.checked_sub(1);
        let expected = place.and_then(|place| reference.predictions.get(place));
        expected == Some(&received.prediction)
    };
    let recording = recording.file_name().unwrap_or_default();
    Ok(Outcome {
        equal: received.iter().filter(is_equal).count(),
        recording: recording.to_string_lossy().into_owned(),
        is_fast: options.fast,
        classifier,
        trials,
        received,
        hops,
    })
}

fn mains_hz(mains: Mains) -> &'static str {
    match mains {
        Mains::Hz50 => "50",
        Mains::Hz60 => "60",
    }
}

/// Returns the group delay of the device's filters, seconds.
fn filter_delay_s(mains: Mains) -> f64 {
    f64::from(mains.filter().group_delay_us) * 1e-6
}

impl Outcome {
    /// Returns the numbers of trials with the right decision, and with any decision.
    pub fn right_and_decided(&self) -> [usize; 2] {
        let decided = self.trials.iter().filter(|trial| trial.decision.is_some());
        let right = decided.clone().filter(|trial| trial.decision == Some(trial.class));
        [right.count(), decided.count()]
    }

    /// Returns the chance level: the share of the most frequent cue among the decided trials.
    fn chance(&self) -> f64 {
        let decided = self.trials.iter().filter(|trial| trial.decision.is_some());
        let of = |class: usize| decided.clone().filter(|trial| trial.class == class).count();
        let most = (0..self.classifier.decision.classes.len()).map(of).max();
        ratio(most.unwrap_or(0), decided.clone().count())
    }

    /// Checks that all predictions arrived, and that they equal the offline predictions.
    ///
    /// # Errors
    /// [`Failure`] if a prediction is missing or differs.
    pub fn check(&self) -> Result<(), Failure> {
        if self.equal == self.hops {
            return Ok(());
        }
        let why = format!("{} of {} predictions are as offline", self.equal, self.hops);
        let next = "is the machine busy? run it again, or with --fast";
        Err(Failure::check("the loop", why, next))
    }
}

#[expect(clippy::cast_precision_loss, reason = "some hundreds of trials")]
fn ratio(part: usize, all: usize) -> f64 {
    part as f64 / all.max(1) as f64
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { classifier, recording, hops, equal, .. } = self;
        let classes = classifier.decision.classes.iter().map(|class| class.event.as_str());
        let [low, high] = classifier.band.hz;
        writeln!(
            f,
            "classifier {:08x} of {}, {low} to {high} Hz, trained on {}",
            classifier.id(),
            classes.collect::<Vec<_>>().join(" and "),
            classifier.training.train_files.join(", ")
        )?;
        let [right, decided] = self.right_and_decided();
        writeln!(
            f,
            "{recording}: {right} of {decided} decided trials right, {:.0} % (chance {:.0} %), \
             {} without a decision",
            100.0 * ratio(right, decided),
            100.0 * self.chance(),
            self.trials.len() - decided
        )?;
        writeln!(f, "predictions: {equal} of {hops} equal those of the integers offline")?;
        if self.is_fast {
            return writeln!(f, "played as fast as possible, so there are no latencies");
        }
        let latencies = self.received.iter().map(|received| received.latency_ms);
        let mut latencies: Vec<f64> = latencies.collect();
        latencies.sort_by(f64::total_cmp);
        let at = |percent: usize| latencies.get(latencies.len() * percent / 100);
        let [half, most] = [50, 99].map(|percent| at(percent).copied().unwrap_or(f64::NAN));
        writeln!(
            f,
            "played in real time: from the last sample of a hop to its probability {half:.1} ms \
             (median), {most:.1} ms (99 %)"
        )
    }
}
