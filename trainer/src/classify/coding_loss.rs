//! How much coding costs a classifier that reads a frequency band through spatial filters.
//!
//! ```text
//! original --> filters of each person --> components in the band --> power
//!    |                  |                                              |  SNR
//! decoded ----- minus original, same filters --------------------> power of the error
//!    |
//! decoded --> CSP and linear discriminant, each recording left out --> AUC
//! ```

use super::fit::{Plan, common_spatial_patterns, fit, shrunk};
use super::options::{TaskOptions, class};
use super::sessions::{Events, Session, Start, read_events};
use super::validation::{cross_validate, folds};
use crate::error::TrainerError;
use crate::people::People;
use artifact::Description;
use artifact::classifier::Class;
use nalgebra::{DMatrix, DVector};
use packed_fit::band_pass::band_passed;
use packed_fit::{FitError, Track, in_parallel};
use serde_json::{Value as Json, json};
use std::fmt;
use std::path::PathBuf;

/// Largest number of spatial filters for each person if `--events` is not given.
const COMPONENTS: usize = 6;

/// Area under the ROC curve for random guesses.
const GUESS: f64 = 0.5;

/// Options of the figures for classifiers.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct ClassifierLossOptions {
    /// Events that start the trials of each class, two or more, as in `trainer classify`. If they
    /// are given, the figures for classifiers include the area under the curve.
    #[arg(long, value_delimiter = ',', value_parser = class)]
    events: Vec<Class>,
    #[command(flatten)]
    task: TaskOptions,
}

/// Loss of classifiers with each code, as a table.
#[derive(Clone, Debug)]
pub(crate) struct ClassifierLossTable {
    /// Area under the ROC curve on the original signals, mean over all people; `None` without
    /// events.
    original_auc: Option<f64>,
    /// Number of trials of all people; only whole trials after the filters have settled are
    /// counted.
    trials: usize,
    /// For each code: its name, the mean ratio in dB of the power of a spatial filter's output to
    /// the power of its error, and the area under the ROC curve.
    rows: Vec<(String, f64, Option<f64>)>,
}

/// Recordings on which the loss of classifiers is measured.
pub(crate) struct CodingLoss {
    tracks: Vec<Track>,
    /// For each person: indices of the recordings, and spatial filters, `[electrode, filter]`.
    people: Vec<(Vec<usize>, DMatrix<f64>)>,
    sections: [[i64; 3]; 2],
    /// Microvolts per unit of the decoded signals.
    unit_uv: f64,
    /// How trials are cut, where sessions start, and the events of each recording; `None` if no
    /// events are given.
    task: Option<(Plan, Start, Vec<Events>)>,
    pub(crate) table: ClassifierLossTable,
}

impl CodingLoss {
    /// Finds the trials of `recordings`, and fits the filters of each person.
    ///
    /// # Errors
    /// If the recordings lack the events, or a person has too few trials or no signal.
    pub(crate) fn new(
        options: &ClassifierLossOptions,
        recordings: &[PathBuf],
        people: &People,
        description: &Description,
        mains_hz: u32,
    ) -> Result<Self, TrainerError> {
        let window = &description.window;
        let whole_hops = |track: &Track| track.part(0..track.steps() / window.hop * window.hop);
        let rate_hz = f64::from(window.rate_hz);
        let mut loss = Self {
            tracks: people.tracks.iter().map(whole_hops).collect(),
            people: Vec::new(),
            sections: model_gen::band_power_sections(options.task.band, rate_hz),
            unit_uv: description.input.sd_uv,
            task: None,
            table: ClassifierLossTable { original_auc: None, trials: 0, rows: Vec::new() },
        };
        if !options.events.is_empty() {
            let plan = Plan::new(&options.events, &options.task, None, None, description)?;
            let start = Start::new(description, mains_hz, &plan)?;
            let events = read_events(recordings, start, &plan, "--test")?;
            loss.task = Some((plan, start, events));
        }
        for indices in people.recordings() {
            let filters = match &loss.task {
                Some((plan, ..)) => {
                    let sessions = loss.sessions(&loss.tracks, &indices);
                    plan.check_trials(&sessions)?;
                    loss.table.trials += sessions.iter().map(|s| s.trials.len()).sum::<usize>();
                    let trials = sessions.iter().flat_map(Session::with_trials);
                    fit(plan, &trials.collect::<Vec<_>>())?.filters
                }
                None => loss.leading_filters(&indices)?,
            };
            loss.people.push((indices, filters));
        }
        loss.table.original_auc = loss.auc(&loss.tracks, None)?;
        Ok(loss)
    }

    /// Measures the loss of classifiers on the decoded signals of a code, one signal for each
    /// recording, in units of `input.sd_uv`.
    ///
    /// # Errors
    /// If no device could run a classifier of the decoded signals.
    pub(crate) fn add<'d>(
        &mut self,
        code: &str,
        decoded: impl Iterator<Item = &'d [f32]>,
    ) -> Result<(), TrainerError> {
        let decoded = self.tracks.iter().zip(decoded).map(|(track, values)| {
            #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
            let microvolts = |value: &f32| (f64::from(*value) * self.unit_uv) as f32;
            with_values(track, values.iter().map(microvolts))
        });
        let decoded: Vec<Track> = decoded.collect();
        let ratios = self.people.iter().map(|(indices, filters)| {
            let powers = in_parallel::map(indices, |&index| {
                let original = &self.tracks[index];
                let errors = original.values.iter().zip(&decoded[index].values);
                let error = with_values(original, errors.map(|(uv, decoded)| uv - decoded));
                [original, &error].map(|track| {
                    let components = filters.tr_mul(&band_passed(track, &self.sections));
                    components.map(|value| value.powi(2)).column_sum()
                })
            });
            let sum = |at: usize| powers.iter().map(|pair| &pair[at]).sum::<DVector<f64>>();
            let (signal, error) = (sum(0), sum(1));
            signal.zip_map(&error, |s: f64, e: f64| 10.0 * (s / e).log10()).mean()
        });
        let snr_db = ratios.sum::<f64>() / self.people.len() as f64;
        let auc = self.auc(&decoded, Some(GUESS))?;
        self.table.rows.push((code.to_owned(), snr_db, auc));
        Ok(())
    }

    /// Returns the area under the ROC curve, averaged over all people; `None` without events.
    /// `silent` is the area that is assumed for a person whose decoded signals are all 0; if it is
    /// `None`, such signals are an error.
    fn auc(&self, tracks: &[Track], silent: Option<f64>) -> Result<Option<f64>, TrainerError> {
        let Some((plan, ..)) = &self.task else {
            return Ok(None);
        };
        let each = self.people.iter().map(|(indices, _)| {
            let sessions = self.sessions(tracks, indices);
            match (cross_validate(plan, &sessions, &folds(&sessions)), silent) {
                (Ok((figures, _)), _) => Ok(figures.auc_float),
                (Err(TrainerError::Fit(FitError::Silent)), Some(guess)) => Ok(guess),
                (Err(error), _) => Err(error),
            }
        });
        let sum = each.sum::<Result<f64, TrainerError>>()?;
        Ok(Some(sum / self.people.len() as f64))
    }

    fn sessions(&self, tracks: &[Track], indices: &[usize]) -> Vec<Session> {
        let session = |&index: &usize| {
            let (plan, start, events) = self.task.as_ref()?;
            let track = start.cut(&tracks[index]);
            Some(Session::new(track, &events[index], plan))
        };
        indices.iter().filter_map(session).collect()
    }

    /// Returns the spatial filters whose output has the most power in the band, relative to its
    /// power at all frequencies.
    fn leading_filters(&self, indices: &[usize]) -> Result<DMatrix<f64>, TrainerError> {
        let moments = in_parallel::map(indices, |&index| {
            [&self.sections[..], &[]].map(|sections| {
                let signals = band_passed(&self.tracks[index], sections);
                &signals * signals.transpose()
            })
        });
        let means = [0, 1].map(|at| {
            let sum = moments.iter().map(|pair| &pair[at]).sum::<DMatrix<f64>>();
            let power = sum.trace();
            shrunk(sum / power)
        });
        let count = COMPONENTS.min(means[0].nrows());
        let filters = common_spatial_patterns(&means, count).ok_or(FitError::Silent)?;
        Ok(filters.columns(0, count).into_owned())
    }
}

fn with_values(track: &Track, values: impl Iterator<Item = f32>) -> Track {
    Track { values: values.collect(), ..track.part(0..0) }
}

impl ClassifierLossTable {
    pub(crate) fn to_json(&self) -> Json {
        let row = |(code, snr_db, auc): &(String, f64, Option<f64>)| json!({ "code": code, "snr_db": snr_db, "auc": auc });
        let codes: Vec<Json> = self.rows.iter().map(row).collect();
        json!({ "original_auc": self.original_auc, "trials": self.trials, "codes": codes })
    }
}

impl fmt::Display for ClassifierLossTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nfor classifiers of a band: spatially filtered components")?;
        let Some(original) = self.original_auc else {
            writeln!(f, "code                 SNR dB")?;
            let mut rows = self.rows.iter();
            return rows.try_for_each(|(code, snr_db, _)| writeln!(f, "{code:<18} {snr_db:>8.2}"));
        };
        writeln!(f, "code                 SNR dB    AUC %   difference")?;
        writeln!(f, "{:<27} {:>8.1}   {} trials", "original", 100.0 * original, self.trials)?;
        for (code, snr_db, auc) in &self.rows {
            let auc = auc.unwrap_or(GUESS);
            let [auc, difference] = [auc, auc - original].map(|part| 100.0 * part);
            writeln!(f, "{code:<18} {snr_db:>8.2} {auc:>8.1} {difference:>+12.1}")?;
        }
        Ok(())
    }
}
