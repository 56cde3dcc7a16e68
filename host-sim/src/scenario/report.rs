//! What a rehearsal found, as one line and as figures.

use std::fmt;

use bridge_core::Summary;
use link::Streams;
use neuro_ros::DiagnosticArray;
use serde::Serialize;

use super::file::Scenario;
use super::ledger::{Ledger, StampError};
use super::line::LineCounts;
use super::schedule::Schedule;
use super::topic::Topic;
use super::truth::{TopicKind, Truth};

/// What happened on the line and in the host, counted where it happened.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Facts {
    /// Frames that arrived undamaged, those that arrived once more, and damaged stretches between
    /// two zeros.
    pub(super) arrived: u64,
    pub(super) repeated: u64,
    pub(super) damaged: u64,
    pub(super) dropped_by_board: u64,
    /// Frames sent while the cable was unplugged or the host's buffer full.
    pub(super) unreceived: u64,
    pub(super) line: LineCounts,
    pub(super) acks_lost: u64,
    pub(super) restarts: u64,
    pub(super) is_stopped: bool,
    /// Whether a code, block or sample was flagged for a fault of the converters, or for a rail.
    pub(super) converters_seen: bool,
    pub(super) rails_seen: bool,
}

/// Counts of a topic, in rows: codes, packed blocks, samples or steps.
#[derive(Clone, Debug, Serialize)]
pub struct TopicReport {
    /// What the topic's rows are.
    pub rows: &'static str,
    /// Rows that the board made.
    pub made: u64,
    /// Rows that were published.
    pub published: u64,
    /// Rows that the board made and that are counted as lost.
    pub lost: u64,
    /// Rows that the board made when an interruption began, of which no later frame told the host.
    /// The time between two runs, which is filled, contains them.
    pub interrupted: u64,
    /// Fillers that were published.
    pub fillers: u64,
    /// Errors: rows that the board did not make, rows out of order or published twice, fillers that
    /// stand for nothing, and stamps that go back.
    pub wrong: u64,
}

/// The result of a rehearsal.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the scenario.
    pub name: String,
    /// Duration, seconds of the host's time.
    pub seconds: f64,
    /// What was exceeded, or does not agree; empty if the scenario has passed.
    pub failures: Vec<String>,
    /// The topics that were streamed.
    pub topics: Vec<TopicReport>,
    /// Error of the settled stamps beyond the shortest delay: 99 % of them, and the largest,
    /// milliseconds.
    pub stamp_p99_ms: f64,
    /// The largest of these errors, milliseconds.
    pub stamp_max_ms: f64,
    /// The largest error of the other stamps, milliseconds.
    pub unsettled_max_ms: f64,
    /// Shortest time from a row's last sample to the host, by which all stamps are late,
    /// milliseconds.
    pub shortest_delay_ms: f64,
    /// Edges of the trigger that the board sent.
    pub edges: u64,
    /// Edges that were published.
    pub edges_published: u64,
    /// Largest error of an event, settled or not, milliseconds.
    pub event_max_ms: f64,
    /// Longest time from the end of a fault to the next row that is no filler, seconds.
    pub recovery_s: f64,
    /// Largest error of the number of rows that fill interruptions, milliseconds.
    pub gap_error_ms: f64,
    /// Frames that the board made.
    pub frames: u64,
    /// Frames that arrived undamaged.
    pub frames_arrived: u64,
    /// Damaged stretches that arrived.
    pub frames_damaged: u64,
    /// Frames that the board dropped because the line did not carry them.
    pub frames_dropped_by_board: u64,
    /// Restarts of the board.
    pub restarts: u64,
}

impl Report {
    pub(super) fn new(
        scenario: &Scenario,
        summary: &Summary,
        ledger: &Ledger,
        truth: &Truth,
        schedule: &Schedule,
        facts: &Facts,
    ) -> Self {
        let streamed =
            |(kind, topic): (TopicKind, _)| streams(kind, scenario.streams).then_some(topic);
        let topics: Vec<&Topic> = TopicKind::ALL
            .into_iter()
            .zip(&ledger.topics)
            .filter_map(streamed)
            .collect();
        let worst = |errors: &[f64]| errors.last().copied().unwrap_or_default();
        let settled = sizes(ledger, |error| error.is_settled && !error.is_event);
        let p99 = settled.get(settled.len() * 99 / 100).copied();
        let ms = |us: f64| (us / 1e3 * 1e3).round() / 1e3;
        let report = Self {
            name: scenario.name.clone(),
            seconds: scenario.duration_s,
            failures: Vec::new(),
            topics: topics.iter().map(|topic| TopicReport::new(topic)).collect(),
            stamp_p99_ms: ms(p99.unwrap_or_default()),
            stamp_max_ms: ms(worst(&settled)),
            unsettled_max_ms: ms(worst(&sizes(ledger, |error| !error.is_settled))),
            shortest_delay_ms: ms(if ledger.shortest_us.is_finite() {
                ledger.shortest_us
            } else {
                0.0
            }),
            edges: truth.edges,
            edges_published: ledger.edges,
            event_max_ms: ms(worst(&sizes(ledger, |error| error.is_event))),
            recovery_s: ms(ledger.longest_recovery.0 / 1e3),
            gap_error_ms: ms(topics
                .iter()
                .map(|topic| topic.worst_gap_us)
                .fold(0.0, f64::max)),
            frames: truth.frames,
            frames_arrived: facts.arrived,
            frames_damaged: facts.damaged,
            frames_dropped_by_board: facts.dropped_by_board,
            restarts: facts.restarts,
        };
        let mut failures = Self::unrehearsed(scenario, schedule, facts);
        failures.extend(topics.iter().filter_map(|topic| {
            topic.first_wrong.clone().map(|first| {
                format!(
                    "{} errors in {}; the first: {first}; look at host/bridge-core/src/streams",
                    topic.wrong, topic.name
                )
            })
        }));
        failures.extend(report.unbalanced(summary, ledger, &topics, facts));
        failures.extend(report.exceeded(scenario, ledger));
        Self { failures, ..report }
    }

    /// Returns whether the scenario has passed.
    pub fn passed(&self) -> bool {
        self.failures.is_empty()
    }

    /// Returns a sentence for each fault that did not take place.
    fn unrehearsed(scenario: &Scenario, schedule: &Schedule, facts: &Facts) -> Vec<String> {
        let (noise, line) = (scenario.noise, facts.line);
        let without: Vec<String> = schedule
            .without_effect()
            .map(|(kind, at_s)| format!("the fault {kind:?} at {at_s} s"))
            .chain(
                [
                    ("bit_errors", noise.bit_errors, line.bit_errors),
                    ("frames_dropped", noise.frames_dropped, line.frames_dropped),
                    (
                        "frames_duplicated",
                        noise.frames_duplicated,
                        line.frames_duplicated,
                    ),
                    ("chunks_dropped", noise.chunks_dropped, line.chunks_dropped),
                    (
                        "chunks_duplicated",
                        noise.chunks_duplicated,
                        line.chunks_duplicated,
                    ),
                ]
                .into_iter()
                .filter(|(_, rate, count)| *rate > 0.0 && *count == 0)
                .map(|(name, ..)| format!("noise.{name}")),
            )
            .chain(
                [
                    (
                        "converters",
                        !scenario.converters.is_empty(),
                        facts.converters_seen,
                    ),
                    ("source.rails", scenario.source.rails, facts.rails_seen),
                ]
                .into_iter()
                .filter(|(_, is_wanted, seen)| *is_wanted && !seen)
                .map(|(name, ..)| name.to_owned()),
            )
            .collect();
        let say = |what| {
            format!(
                "{what} had no effect, so nothing was rehearsed; move it, or raise its rate or duration_s"
            )
        };
        without.into_iter().map(say).collect()
    }

    /// Returns a sentence for each count that differs from what happened.
    fn unbalanced(
        &self,
        summary: &Summary,
        ledger: &Ledger,
        topics: &[&Topic],
        facts: &Facts,
    ) -> Vec<String> {
        let wire = &summary.wire;
        let refused =
            wire.crc + wire.cobs + wire.oversize + wire.malformed + wire.version + wire.unknown;
        let shown = |name: &str| shown(&ledger.diagnostics, name);
        let mut pairs = vec![
            (
                "frames received",
                u64::from(wire.frames),
                facts.arrived + facts.repeated,
            ),
            ("frames damaged", refused.into(), facts.damaged),
            (
                "/diagnostics: device: frames dropped",
                shown("device: frames dropped"),
                facts.dropped_by_board,
            ),
        ];
        for topic in topics {
            let (published, lost, fillers) = (topic.published, topic.lost(), topic.fillers);
            let packed = &summary.packed;
            match topic.name {
                "codes" => pairs.extend([
                    ("codes received", summary.received, published),
                    ("codes lost", summary.lost, lost),
                    ("fillers", summary.fillers, fillers),
                    (
                        "codes made after the last that is known",
                        topic.unknown()[1],
                        0,
                    ),
                    ("/diagnostics: received", shown("received"), published),
                    ("/diagnostics: lost", shown("lost"), lost),
                    ("/diagnostics: fillers", shown("fillers"), fillers),
                ]),
                "packed blocks" => pairs.extend([
                    ("packed blocks received", packed.received, published),
                    ("packed blocks lost", packed.lost, lost),
                    ("packed fillers", packed.fillers, fillers),
                ]),
                name => {
                    let [received, between, unpublished] =
                        ["received", "missing between runs", "not published"]
                            .map(|what| shown(&format!("{name} {what}")));
                    let of_core = received + shown(&format!("{name} lost")) + between;
                    pairs.push((name, of_core, published + fillers + unpublished));
                }
            }
        }
        if self.edges > 0 {
            pairs.push((
                "/diagnostics: events received",
                shown("events received"),
                self.edges_published,
            ));
            pairs.push(("edges that the board did not send", ledger.wrong_edges, 0));
        }
        let differ = pairs
            .into_iter()
            .filter(|(_, core, true_count)| core != true_count);
        let mut failures: Vec<String> = differ
            .map(|(what, core, true_count)| {
                format!("the ledger does not close: {what}: {core}, in truth {true_count}")
            })
            .collect();
        if !facts.is_stopped {
            failures.push(
                "at the end the board did not confirm that it stopped; is a fault still active?"
                    .to_owned(),
            );
        }
        failures
    }

    /// Returns a sentence for each limit that was exceeded.
    fn exceeded(&self, scenario: &Scenario, ledger: &Ledger) -> Vec<String> {
        let limits = scenario.limits;
        let when = |is_event: bool, is_settled: bool| {
            let of_kind = |error: &&StampError| {
                error.is_event == is_event && (is_event || error.is_settled == is_settled)
            };
            let size = |error: &StampError| (error.error_us - ledger.shortest_us).abs();
            let worst = ledger
                .errors
                .iter()
                .filter(of_kind)
                .max_by(|a, b| size(a).total_cmp(&size(b)));
            worst.map_or(0.0, |error| error.at_us / 1e6)
        };
        #[expect(clippy::cast_precision_loss, reason = "far below 2^52 rows")]
        let fillers = self
            .topics
            .iter()
            .map(|topic| topic.fillers as f64 / (topic.fillers + topic.published).max(1) as f64);
        #[expect(clippy::cast_precision_loss, reason = "far below 2^52 edges")]
        let lost_edges = self.edges.saturating_sub(self.edges_published) as f64;
        #[expect(clippy::cast_precision_loss, reason = "a count of edges")]
        let most_lost = limits.lost_events as f64;
        let recovered_s = ledger.longest_recovery.1 / 1e6;
        let figures = [
            (
                "stamp error p99, ms",
                self.stamp_p99_ms,
                limits.stamp_p99_ms,
                when(false, true),
                "stamp_p99_ms",
            ),
            (
                "stamp error, ms",
                self.stamp_max_ms,
                limits.stamp_max_ms,
                when(false, true),
                "stamp_max_ms",
            ),
            (
                "unsettled error, ms",
                self.unsettled_max_ms,
                limits.unsettled_max_ms,
                when(false, false),
                "unsettled_max_ms",
            ),
            (
                "event error, ms",
                self.event_max_ms,
                limits.event_max_ms.max(limits.unsettled_max_ms),
                when(true, true),
                "event_max_ms",
            ),
            ("lost events", lost_edges, most_lost, 0.0, "lost_events"),
            (
                "share of fillers",
                fillers.fold(0.0, f64::max),
                limits.fillers,
                0.0,
                "fillers",
            ),
            (
                "recovery, s",
                self.recovery_s,
                limits.recovery_s,
                recovered_s,
                "recovery_s",
            ),
            (
                "error of a gap, ms",
                self.gap_error_ms,
                limits.gap_error_ms,
                0.0,
                "gap_error_ms",
            ),
        ];
        let exceeded = figures
            .into_iter()
            .filter(|(_, figure, limit, ..)| figure > limit);
        let mut failures: Vec<String> = exceeded
            .map(|(what, figure, limit, at_s, key)| {
                let at = if at_s > 0.0 {
                    format!(" at {at_s:.3} s")
                } else {
                    String::new()
                };
                format!("{what}: {figure:.4}{at}, limit {limit} (limits.{key})")
            })
            .collect();
        if let Some(end_us) = ledger.not_recovered() {
            failures.push(format!(
                "nothing was published after the fault that ended at {:.3} s",
                end_us / 1e6
            ));
        }
        if self.topics.iter().all(|topic| topic.published == 0) {
            failures.push("nothing was published".to_owned());
        }
        failures
    }
}

impl TopicReport {
    fn new(topic: &Topic) -> Self {
        Self {
            rows: topic.name,
            made: topic.made(),
            published: topic.published,
            lost: topic.lost(),
            interrupted: topic.unknown()[0],
            fillers: topic.fillers,
            wrong: topic.wrong,
        }
    }
}

/// Returns whether `streams` has rows of this topic.
fn streams(kind: TopicKind, streams: Streams) -> bool {
    match kind {
        TopicKind::Encoded => bridge_core::with_codes(streams).contains(Streams::CODES),
        TopicKind::Packed => streams.contains(Streams::PACKED),
        TopicKind::Raw => bridge_core::RawForm::any_in(streams),
        TopicKind::Filtered => streams.contains(Streams::FILTERED),
    }
}

/// Returns the sizes of those errors for which `is_one` holds, smallest first, microseconds.
fn sizes(ledger: &Ledger, is_one: impl Fn(&StampError) -> bool) -> Vec<f64> {
    let errors = ledger.errors.iter().filter(|error| is_one(error));
    let mut sizes: Vec<f64> = errors
        .map(|error| (error.error_us - ledger.shortest_us).abs())
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes
}

/// Returns a count on `/diagnostics`; 0 if it is not there.
fn shown(diagnostics: &DiagnosticArray, name: &str) -> u64 {
    let values = diagnostics.status.iter().flat_map(|status| &status.values);
    let mut found = values.filter(|value| value.key == name);
    found
        .next()
        .and_then(|value| value.value.parse().ok())
        .unwrap_or_default()
}

/// Writes the verdict, one line.
impl fmt::Display for Report {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = if self.passed() { "PASS" } else { "FAIL" };
        write!(formatter, "{verdict} {}: {} s", self.name, self.seconds)?;
        for topic in &self.topics {
            let TopicReport {
                rows,
                published,
                wrong,
                fillers,
                ..
            } = topic;
            write!(
                formatter,
                ", {published} {rows}, {wrong} wrong, {fillers} fillers"
            )?;
        }
        write!(
            formatter,
            ", stamp error p99 {:.2} ms max {:.2} ms, unsettled {:.2} ms",
            self.stamp_p99_ms, self.stamp_max_ms, self.unsettled_max_ms
        )?;
        if self.edges > 0 {
            write!(
                formatter,
                ", {} of {} events, error {:.2} ms",
                self.edges_published, self.edges, self.event_max_ms
            )?;
        }
        match self.failures.as_slice() {
            [] => write!(formatter, ", ledger closed"),
            failures => write!(formatter, ": {}", failures.join("; ")),
        }
    }
}
