//! Compares the rows that the core publishes on a topic with the rows that the board made.

use std::collections::VecDeque;

use link::Streams;
use serde::Serialize;

use super::report::count;
use super::truth::{Row, TopicKind, Values};

/// Counts of a topic, in rows: codes, packed blocks, samples or steps.
#[derive(Clone, Debug, Serialize)]
pub struct TopicCounts {
    /// Name of the rows, such as "codes".
    pub rows: &'static str,
    /// Rows that the board made.
    pub made: u64,
    /// Rows that were published, without fillers.
    pub published: u64,
    /// Rows that the board made and that are counted as lost.
    pub lost: u64,
    /// Rows that the board made just before an interruption and that no later frame reported to the
    /// host. They lie in the time between two runs, which fillers represent.
    pub interrupted: u64,
    /// Fillers that were published.
    pub fillers: u64,
    /// Errors: rows that the board did not make, rows out of order or published twice, more or
    /// fewer fillers than missing rows, and stamps that go back.
    pub wrong: u64,
}

impl TopicCounts {
    /// Returns the fraction of the rows that are fillers.
    pub(super) fn share_of_fillers(&self) -> f64 {
        count(self.fillers) / count((self.fillers + self.published).max(1))
    }
}

/// Rows that were published on a topic, compared with the rows that the board made.
#[derive(Debug)]
pub(super) struct Topic {
    pub(super) name: &'static str,
    /// Time between two rows by the stated rate, microseconds.
    period_us: f64,
    /// True if a row is published when it arrives, false if it waits until its frame is full.
    is_immediate: bool,
    /// Number of rows that the board made in each run.
    made: Vec<u64>,
    /// Number of rows of each run that the host knows of: those up to the newest published row, or
    /// those that the board has reported as made, whichever are more.
    known: Vec<u64>,
    /// Rows that have arrived and can be published, oldest first.
    arrived: VecDeque<Row>,
    /// The newest published row that is not a filler.
    newest: Option<Row>,
    /// Number of fillers since `newest`.
    fillers_since: u64,
    published: u64,
    fillers: u64,
    wrong: u64,
    /// Sum over all interruptions so far: number of rows published, fillers included, minus the
    /// number of row periods that the interruption lasted.
    gap_error: f64,
    pub(super) worst_gap_us: f64,
    /// Description of the first error; `None` if there was none so far.
    first_wrong: Option<String>,
}

impl Topic {
    fn new(name: &'static str, rate_hz: f64, is_immediate: bool) -> Self {
        Self {
            name,
            period_us: 1e6 / rate_hz,
            is_immediate,
            made: Vec::new(),
            known: Vec::new(),
            arrived: VecDeque::new(),
            newest: None,
            fillers_since: 0,
            published: 0,
            fillers: 0,
            wrong: 0,
            gap_error: 0.0,
            worst_gap_us: 0.0,
            first_wrong: None,
        }
    }

    pub(super) fn record_made(&mut self, row: &Row) {
        let run = row.place.run;
        self.made.resize(self.made.len().max(run + 1), 0);
        self.known.resize(self.made.len(), 0);
        self.made[run] = row.place.index + 1;
    }

    /// Records rows that have arrived at the host, undamaged.
    pub(super) fn record_arrived(&mut self, rows: &[Row]) {
        self.arrived.extend(rows.iter().cloned());
    }

    /// Records that the board has reported `made` rows in run number `run`, and that the core has
    /// filled in the missing rows.
    pub(super) fn record_stated(&mut self, run: usize, made: u64) {
        if let Some(known) = self.known.get_mut(run) {
            *known = made.max(*known);
        }
    }

    pub(super) fn record_filler(&mut self) {
        self.fillers += 1;
        self.fillers_since += u64::from(self.newest.is_some());
    }

    /// Compares a published row that is not a filler with the rows that have arrived. Returns the
    /// arrived row that equals it; `None` if there is none.
    pub(super) fn compare(&mut self, values: &Values, flags: u16, now_us: f64) -> Option<Row> {
        let seconds = now_us / 1e6;
        // Rows that were refused, or that a lost block made useless, are skipped.
        let is_it = |row: &Row| row.values == *values && row.flags == flags;
        let found = if self.is_immediate {
            self.arrived.iter().rposition(is_it)
        } else {
            self.arrived.iter().position(is_it)
        };
        let Some(found) = found else {
            let next = self.arrived.front().map(|row| row.place);
            self.report_wrong(format!(
                "at {seconds:.3} s a row was published that the board did not make (next in line: {next:?})"
            ));
            return None;
        };
        let row = self.arrived.drain(..=found).next_back()?;
        let place = row.place;
        self.published += 1;
        let fillers = std::mem::take(&mut self.fillers_since);
        if let Some(newest) = self.newest.replace(row.clone()).map(|row| row.place) {
            if place.run == newest.run {
                let missing = place.index - newest.index - 1;
                if fillers != missing {
                    self.report_wrong(format!(
                        "at {seconds:.3} s {fillers} fillers stand for {missing} missing rows"
                    ));
                }
            } else {
                let rows = count(fillers + 1);
                self.gap_error += rows - (place.scalp_us - newest.scalp_us) / self.period_us;
                let error_us = self.gap_error.abs() * self.period_us;
                self.worst_gap_us = self.worst_gap_us.max(error_us);
            }
        }
        self.known[place.run] = self.known[place.run].max(place.index + 1);
        Some(row)
    }

    pub(super) fn report_wrong(&mut self, what: String) {
        self.wrong += 1;
        self.first_wrong.get_or_insert(what);
    }

    pub(super) fn counts(&self) -> TopicCounts {
        TopicCounts {
            rows: self.name,
            made: self.made.iter().sum(),
            published: self.published,
            lost: self.known.iter().sum::<u64>().saturating_sub(self.published),
            interrupted: self.unknown()[0],
            fillers: self.fillers,
            wrong: self.wrong,
        }
    }

    /// Returns a sentence about the errors; `None` without errors.
    pub(super) fn failure(&self) -> Option<String> {
        let (first, wrong, name) = (self.first_wrong.as_ref()?, self.wrong, self.name);
        let remedy = "look at host/bridge-core/src/streams";
        Some(format!("{wrong} errors in {name}; the first: {first}; {remedy}"))
    }

    /// Returns the number of rows at the ends of runs that the host cannot know of: first the sum
    /// over all interrupted runs, then the number for the newest run.
    pub(super) fn unknown(&self) -> [u64; 2] {
        let unknown = self.made.iter().zip(&self.known).map(|(made, known)| made - known);
        let newest = unknown.clone().next_back().unwrap_or_default();
        [unknown.sum::<u64>() - newest, newest]
    }
}

impl TopicKind {
    pub(super) const ALL: [Self; 4] = [Self::Encoded, Self::Packed, Self::Raw, Self::Filtered];

    /// Returns whether `streams` has rows of this topic.
    pub(super) fn is_in(self, streams: Streams) -> bool {
        match self {
            Self::Encoded => bridge_core::with_codes(streams).contains(Streams::CODES),
            Self::Packed => streams.contains(Streams::PACKED),
            Self::Raw => bridge_core::RawForm::any_in(streams),
            Self::Filtered => streams.contains(Streams::FILTERED),
        }
    }

    /// Returns the topic, with the name of its rows in `/diagnostics` and the documentation.
    pub(super) fn topic(self) -> Topic {
        let step_hz = f64::from(model::STEP_RATE_HZ);
        #[expect(clippy::cast_precision_loss, reason = "a few steps")]
        let hop_hz = step_hz / model::HOP as f64;
        match self {
            Self::Encoded => Topic::new("codes", hop_hz, true),
            Self::Packed => Topic::new("packed blocks", hop_hz, true),
            Self::Raw => Topic::new("raw samples", model::ADC_RATE_HZ.into(), false),
            Self::Filtered => Topic::new("filtered steps", step_hz, false),
        }
    }
}
