//! What coding costs a decoder that reads a band through spatial filters.
//!
//! ```text
//! original --> filters of each person --> components in the band --> power
//!    |                  |                                              |  SNR
//! decoded ----- minus original, same filters --------------------> power of the error
//!    |
//! decoded --> CSP and linear discriminant, each recording left out --> AUC
//! ```

use super::fit::{FloatDecoder, Plan, common_spatial_patterns};
use super::options::{TaskOptions, class};
use super::sessions::{Events, Session, Start, read_events};
use super::validation::float_auc;
use crate::error::TrainerError;
use crate::people::People;
use artifact::Description;
use artifact::classifier::Class;
use nalgebra::DMatrix;
use packed_fit::band_pass::band_passed;
use packed_fit::{FitError, Track, in_parallel};
use std::path::PathBuf;

/// Number of components if there are no events.
const COMPONENTS: usize = 6;

/// Area under the curve of guesses.
const GUESS: f64 = 0.5;

/// Options of the figures for decoders.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct DecoderOptions {
    /// Events that start the trials of each class, two or more, as in `trainer classify`: then the
    /// figures for decoders have the area under the curve too.
    #[arg(long, value_delimiter = ',', value_parser = class)]
    events: Vec<Class>,
    #[command(flatten)]
    task: TaskOptions,
}

/// How well a decoder does with decoded signals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecoderFigures {
    /// Power of the band after a spatial filter, divided by that of its error, dB: mean over the
    /// filters of each person, and over the people.
    pub snr_db: f64,
    /// Area under the curve of a decoder that is trained and tested on decoded signals, mean over the
    /// people; `None` without events.
    pub auc: Option<f64>,
}

/// Recordings on which the loss of a decoder is measured.
pub(crate) struct CodingLoss {
    people: Vec<Person>,
    tracks: Vec<Track>,
    sections: [[i64; 3]; 2],
    /// Trials, if events are named.
    task: Option<Task>,
    /// Area under the curve on the original signals, if events are named.
    pub(crate) original_auc: Option<f64>,
}

/// The trials of recordings.
struct Task {
    plan: Plan,
    start: Start,
    /// Events of each recording.
    events: Vec<Events>,
}

/// A person's recordings.
struct Person {
    /// Indices of the recordings.
    tracks: Vec<usize>,
    /// Spatial filters, `[electrode, filter]`.
    filters: DMatrix<f64>,
}

impl CodingLoss {
    /// Finds the trials of `recordings`, and fits the filters of each person.
    ///
    /// # Errors
    /// If the recordings lack the events or a person has too few trials, or has no signal.
    pub(crate) fn new(
        options: &DecoderOptions,
        recordings: &[PathBuf],
        people: &People,
        description: &Description,
        mains_hz: u32,
    ) -> Result<Self, TrainerError> {
        let rate_hz = f64::from(description.window.rate_hz);
        // Decoded signals are whole hops.
        let hop = description.window.hop;
        let tracks = people.tracks.iter();
        let tracks = tracks.map(|track| track.part(0..track.steps() / hop * hop));
        let mut loss = Self {
            people: Vec::new(),
            tracks: tracks.collect(),
            sections: model_gen::band_power_sections(options.task.band, rate_hz),
            task: None,
            original_auc: None,
        };
        if !options.events.is_empty() {
            let plan = Plan::new(&options.events, &options.task, None, None, description)?;
            let start = Start::new(description, mains_hz, &plan)?;
            let events = read_events(recordings, start, &plan)?;
            loss.task = Some(Task {
                plan,
                start,
                events,
            });
        }
        for tracks in people.recordings() {
            let filters = match &loss.task {
                Some(task) => task.filters(&loss.tracks, &tracks)?,
                None => loss.leading_filters(&tracks)?,
            };
            loss.people.push(Person { tracks, filters });
        }
        loss.original_auc = loss.auc(&loss.tracks)?;
        Ok(loss)
    }

    /// Measures decoded signals, one for each recording: values in units of `unit_uv`.
    ///
    /// # Errors
    /// If a person has too few trials.
    pub(crate) fn measure<'d>(
        &self,
        decoded: impl IntoIterator<Item = &'d [f32]>,
        unit_uv: f64,
    ) -> Result<DecoderFigures, TrainerError> {
        let decoded = self.tracks.iter().zip(decoded).map(|(track, values)| {
            #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
            let scaled = values
                .iter()
                .map(|value| (f64::from(*value) * unit_uv) as f32);
            Track {
                values: scaled.collect(),
                ..track.clone()
            }
        });
        let decoded: Vec<Track> = decoded.collect();
        let ratios = self.people.iter().map(|person| {
            let powers = in_parallel::map(&person.tracks, |&index| {
                let power = |track: &Track| {
                    let signals = band_passed(track, &self.sections);
                    let components = person.filters.tr_mul(&signals);
                    DMatrix::from_fn(1, components.nrows(), |_, row| {
                        components.row(row).norm_squared()
                    })
                };
                let (original, decoded) = (&self.tracks[index], &decoded[index]);
                let errors = original.values.iter().zip(&decoded.values);
                let error = Track {
                    values: errors.map(|(uv, decoded)| uv - decoded).collect(),
                    ..original.clone()
                };
                [power(original), power(&error)]
            });
            let [signal, error] =
                [0, 1].map(|at| powers.iter().map(|p| &p[at]).sum::<DMatrix<f64>>());
            signal.zip_map(&error, |s, e| 10.0 * (s / e).log10()).mean()
        });
        let ratios: Vec<f64> = ratios.collect();
        Ok(DecoderFigures {
            snr_db: ratios.iter().sum::<f64>() / ratios.len() as f64,
            auc: self.auc(&decoded)?,
        })
    }

    /// Returns the mean over people of the area under the curve; `None` without events.
    fn auc(&self, tracks: &[Track]) -> Result<Option<f64>, TrainerError> {
        let Some(task) = &self.task else {
            return Ok(None);
        };
        let each = self.people.iter().map(|person| {
            let sessions = task.sessions(tracks, &person.tracks);
            match float_auc(&task.plan, &sessions) {
                // The coarsest rates can decode to silence, from which a decoder guesses.
                Err(TrainerError::Fit(FitError::Silent)) => Ok(GUESS),
                auc => auc,
            }
        });
        let each = each.collect::<Result<Vec<f64>, _>>()?;
        Ok(Some(each.iter().sum::<f64>() / each.len() as f64))
    }

    /// Returns the filters whose signals have the most power in the band, relative to that at all
    /// frequencies.
    fn leading_filters(&self, tracks: &[usize]) -> Result<DMatrix<f64>, TrainerError> {
        let moments = in_parallel::map(tracks, |&index| {
            let track = &self.tracks[index];
            [band_passed(track, &self.sections), band_passed(track, &[])]
                .map(|signals| &signals * signals.transpose())
        });
        let means = [0, 1].map(|at| {
            let sum = moments.iter().map(|m| &m[at]).sum::<DMatrix<f64>>();
            let trace = sum.trace();
            super::fit::shrunk(sum / trace)
        });
        let filters = common_spatial_patterns(&means, COMPONENTS.min(means[0].nrows()));
        let filters = filters.ok_or(FitError::Silent)?;
        Ok(filters.columns(0, filters.ncols() / 2).into_owned())
    }
}

impl Task {
    fn sessions(&self, tracks: &[Track], indices: &[usize]) -> Vec<Session> {
        let session = |&index: &usize| {
            let track = self.start.cut(&tracks[index]);
            Session::new(track, &self.events[index], &self.plan)
        };
        indices.iter().map(session).collect()
    }

    /// Returns common spatial patterns of all trials.
    fn filters(&self, tracks: &[Track], indices: &[usize]) -> Result<DMatrix<f64>, TrainerError> {
        let sessions = self.sessions(tracks, indices);
        let trials = sessions.iter().flat_map(|session| {
            let trials = session.trials.iter();
            trials.map(move |trial| (session, trial))
        });
        let decoder = FloatDecoder::fit(&self.plan, &trials.collect::<Vec<_>>())?;
        Ok(decoder.filters)
    }
}
