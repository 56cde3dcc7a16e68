//! Result of a rehearsal: its values, and a verdict of one line.

use std::fmt;

use bridge_core::Summary;
use serde::Serialize;

use super::file::Scenario;
use super::ledger::{Ledger, StampError};
use super::schedule::Schedule;
use super::topic::{Topic, TopicCounts};
use super::truth::{TopicKind, Truth};

/// Counts of what happened on the line and in the host, taken independently of the core's counts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Facts {
    /// Frames that arrived undamaged, frames that arrived a second time, and damaged stretches
    /// between two zeros.
    pub(super) arrived: u64,
    pub(super) repeated: u64,
    pub(super) damaged: u64,
    pub(super) dropped_by_board: u64,
    /// Frames sent while the cable was unplugged or the host's buffer was full.
    pub(super) unreceived: u64,
    /// Number of occurrences of each of the line's random faults, in the order of
    /// [`Noise::rates`](super::file::Noise::rates).
    pub(super) line: [u64; 5],
    pub(super) acks_lost: u64,
    pub(super) restarts: u64,
    pub(super) is_stopped: bool,
    /// Whether any code, block or sample had the flag for a fault of the converters, and whether
    /// any had the flag for a rail.
    pub(super) converters_seen: bool,
    pub(super) rails_seen: bool,
}

/// The result of a rehearsal.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the scenario.
    pub name: String,
    /// Duration of the scenario, seconds of host time.
    pub seconds: f64,
    /// Limits that were exceeded, and counts that do not agree; empty if the scenario has passed.
    pub failures: Vec<String>,
    /// The topics that were streamed.
    pub topics: Vec<TopicCounts>,
    /// 99th percentile of the errors of settled stamps, less the line's shortest delay,
    /// milliseconds. Stamps and events are settled from `limits.settle_s` after a start, a restart
    /// or a step of the wall clock on.
    pub stamp_p99_ms: f64,
    /// Largest error of settled stamps, less the shortest delay, milliseconds.
    pub stamp_max_ms: f64,
    /// Largest error of stamps and events that are not settled, less the shortest delay,
    /// milliseconds.
    pub unsettled_max_ms: f64,
    /// Shortest time from a row's last sample to its arrival at the host, milliseconds. All stamps
    /// are late by this time.
    pub shortest_delay_ms: f64,
    /// Edges of the trigger that the board sent.
    pub edges: u64,
    /// Edges that were published.
    pub edges_published: u64,
    /// Largest error of settled events, less the shortest delay, milliseconds.
    pub event_max_ms: f64,
    /// Longest time from the end of a fault to the next row that is not a filler, seconds.
    pub recovery_s: f64,
    /// Largest magnitude of the running sum of all interruptions' errors, milliseconds. The error
    /// of an interruption is the time that its fillers represent, minus its duration.
    pub gap_error_ms: f64,
    /// Frames that the board made.
    pub frames: u64,
    /// Frames that arrived undamaged.
    pub frames_arrived: u64,
    /// Damaged stretches that arrived.
    pub frames_damaged: u64,
    /// Frames that the board dropped because the line carried them too slowly or not at all.
    pub frames_dropped_by_board: u64,
    /// Restarts of the board.
    pub restarts: u64,
}

/// Errors of stamps: 99th percentile and largest, milliseconds, and time of the largest, seconds.
#[derive(Default)]
struct Errors {
    p99_ms: f64,
    max_ms: f64,
    at_s: f64,
}

impl Errors {
    /// Returns the 99th percentile, the maximum and its time for the errors that `is_one` selects.
    /// The line's shortest delay is subtracted from each error.
    fn of(ledger: &Ledger, is_one: impl Fn(&StampError) -> bool) -> Self {
        let errors = ledger.errors.iter().filter(|error| is_one(error));
        let size_us = |error: &StampError| (error.error_us - ledger.shortest_us).abs();
        let mut sizes: Vec<_> = errors.map(|error| (size_us(error), error.at_us)).collect();
        sizes.sort_by(|one, other| one.0.total_cmp(&other.0));
        let (Some(p99), Some(max)) = (sizes.get(sizes.len() * 99 / 100), sizes.last()) else {
            return Self::default();
        };
        Self { p99_ms: rounded(p99.0 / 1e3), max_ms: rounded(max.0 / 1e3), at_s: max.1 / 1e6 }
    }
}

/// Rounds to three decimals.
fn rounded(number: f64) -> f64 {
    (number * 1e3).round() / 1e3
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
            |(kind, topic): (TopicKind, _)| kind.is_in(scenario.streams).then_some(topic);
        let topics = TopicKind::ALL.into_iter().zip(&ledger.topics);
        let topics: Vec<&Topic> = topics.filter_map(streamed).collect();
        let settled = Errors::of(ledger, |error| error.is_settled && !error.is_event);
        let unsettled = Errors::of(ledger, |error| !error.is_settled && !error.is_event);
        let events = Errors::of(ledger, |error| error.is_settled && error.is_event);
        let early_events = Errors::of(ledger, |error| !error.is_settled && error.is_event);
        let (recovery_us, recovered_us) = ledger.longest_recovery;
        let gaps_us = topics.iter().map(|topic| topic.worst_gap_us);
        let gap_us = gaps_us.fold(0.0, f64::max);
        let lost_edges = truth.edges.saturating_sub(ledger.edges);
        let counts: Vec<TopicCounts> = topics.iter().map(|topic| topic.counts()).collect();
        let mut report = Self {
            name: scenario.name.clone(),
            seconds: scenario.duration_s,
            failures: Vec::new(),
            stamp_p99_ms: settled.p99_ms,
            stamp_max_ms: settled.max_ms,
            unsettled_max_ms: unsettled.max_ms.max(early_events.max_ms),
            shortest_delay_ms: rounded(ledger.shortest_us / 1e3),
            edges: truth.edges,
            edges_published: ledger.edges,
            event_max_ms: events.max_ms,
            recovery_s: rounded(recovery_us / 1e6),
            gap_error_ms: rounded(gap_us / 1e3),
            frames: truth.frames,
            frames_arrived: facts.arrived,
            frames_damaged: facts.damaged,
            frames_dropped_by_board: facts.dropped_by_board,
            restarts: facts.restarts,
            topics: counts,
        };
        let limits = scenario.limits;
        let shares = report.topics.iter().map(TopicCounts::share_of_fillers);
        let mut exceeded = Vec::new();
        let mut limit = |key: &str, figure: f64, limit: f64, at_s: f64| {
            let at = |at_s: f64| format!(" at {at_s:.3} s");
            let at = Some(at_s).filter(|at_s| *at_s > 0.0).map(at).unwrap_or_default();
            let text = || format!("{figure:.4}{at} exceeds limits.{key} = {limit}");
            exceeded.extend((figure > limit).then(text));
        };
        limit("stamp_p99_ms", settled.p99_ms, limits.stamp_p99_ms, settled.at_s);
        limit("stamp_max_ms", settled.max_ms, limits.stamp_max_ms, settled.at_s);
        let most = limits.unsettled_max_ms;
        limit("unsettled_max_ms", unsettled.max_ms, most, unsettled.at_s);
        limit("unsettled_max_ms", early_events.max_ms, most, early_events.at_s);
        limit("event_max_ms", events.max_ms, limits.event_max_ms, events.at_s);
        limit("lost_events", count(lost_edges), count(limits.lost_events), 0.0);
        limit("fillers", shares.fold(0.0, f64::max), limits.fillers, 0.0);
        limit("recovery_s", recovery_us / 1e6, limits.recovery_s, recovered_us / 1e6);
        limit("gap_error_ms", gap_us / 1e3, limits.gap_error_ms, 0.0);
        report.failures = unrehearsed(scenario, schedule, facts);
        report.failures.extend(topics.iter().filter_map(|topic| topic.failure()));
        report.failures.extend(unequal(summary, ledger, &topics, truth, facts));
        report.failures.extend(exceeded);
        report.failures.extend(ledger.not_recovered());
        if report.topics.iter().all(|topic| topic.published == 0) {
            report.failures.push("nothing was published".to_owned());
        }
        report
    }

    /// Returns whether the scenario has passed: [`Self::failures`] is empty.
    pub fn passed(&self) -> bool {
        self.failures.is_empty()
    }
}

#[expect(clippy::cast_precision_loss, reason = "far below 2^52")]
pub(super) fn count(number: u64) -> f64 {
    number as f64
}

/// Returns a sentence for each fault that had no effect.
fn unrehearsed(scenario: &Scenario, schedule: &Schedule, facts: &Facts) -> Vec<String> {
    let noise = scenario.noise.rates().into_iter().zip(facts.line);
    let noise = noise.filter(|((_, rate), effects)| *rate > 0.0 && *effects == 0);
    let converters = !scenario.converters.is_empty() && !facts.converters_seen;
    let rails = scenario.source.rails && !facts.rails_seen;
    let flags = [("converters", converters), ("source.rails", rails)];
    let flags = flags.into_iter().filter(|(_, is_missing)| *is_missing);
    let scheduled = schedule.without_effect();
    let scheduled = scheduled.map(|(kind, at_s)| format!("the fault {kind:?} at {at_s} s"));
    let all = scheduled.chain(noise.map(|((name, _), _)| format!("noise.{name}")));
    let all = all.chain(flags.map(|(name, _)| name.to_owned()));
    let remedy =
        "had no effect, so nothing was rehearsed; move it, or raise its rate or duration_s";
    all.map(|what| format!("{what} {remedy}")).collect()
}

/// Compares the core's counts with what happened. Returns a sentence for each count that is wrong.
fn unequal(
    summary: &Summary,
    ledger: &Ledger,
    topics: &[&Topic],
    truth: &Truth,
    facts: &Facts,
) -> Vec<String> {
    let mut unequal = Vec::new();
    let mut compare = |what: &str, counted: u64, happened: u64| {
        if counted != happened {
            let remedy = "look at host/bridge-core/src/streams/ledger.rs";
            unequal.push(format!(
                "the ledger does not close: {what}: {counted}, in truth {happened}; {remedy}"
            ));
        }
    };
    let wire = &summary.wire;
    let damaged = wire.crc + wire.cobs + wire.oversize + wire.malformed;
    let damaged = damaged + wire.version + wire.unknown;
    compare("frames received", wire.frames.into(), facts.arrived + facts.repeated);
    compare("frames damaged", damaged.into(), facts.damaged);
    let dropped = ledger.shown(": device", "device: frames dropped");
    compare("frames dropped by the board", dropped, facts.dropped_by_board);
    compare("events that the board did not send", ledger.wrong_edges, 0);
    compare("confirmations that the board stopped", facts.is_stopped.into(), 1);
    if truth.edges > 0 {
        let received = ledger.shown(": loss", "events received");
        compare("events received", received, ledger.edges);
    }
    for topic in topics {
        let (name, rows, packed) = (topic.name, topic.counts(), summary.packed);
        let (status, core) = match name {
            "codes" => (": loss", [summary.received, summary.lost, summary.fillers]),
            "packed blocks" => (": packed code", [packed.received, packed.lost, packed.fillers]),
            _ => {
                let shown = |what: &str| ledger.shown(": loss", &format!("{name} {what}"));
                let made = shown("received") + shown("lost") + shown("missing between runs");
                let published = rows.published + rows.fillers + shown("not published");
                compare(name, made, published);
                continue;
            }
        };
        let happened = [rows.published, rows.lost, rows.fillers];
        let keys = ["received", "lost", "fillers"];
        for ((key, counted), happened) in keys.into_iter().zip(core).zip(happened) {
            compare(&format!("{name} {key}"), counted, happened);
            let shown = ledger.shown(status, key);
            compare(&format!("{name} {key} on /diagnostics"), shown, happened);
        }
        // When a board stops, it reports how many codes it has made, so the host must have counted
        // all codes of the last run. The board reports no such number for other rows.
        if name == "codes" {
            compare("codes made at the end and not counted", topic.unknown()[1], 0);
        }
    }
    unequal
}

/// Writes the verdict, one line.
impl fmt::Display for Report {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = if self.passed() { "PASS" } else { "FAIL" };
        write!(formatter, "{verdict} {}: {} s", self.name, self.seconds)?;
        for topic in &self.topics {
            let TopicCounts { rows, published, wrong, fillers, .. } = topic;
            write!(formatter, ", {published} {rows}, {wrong} wrong, {fillers} fillers")?;
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
