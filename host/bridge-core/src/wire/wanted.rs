//! Streams that the bridge wants from a device, and the schedule of its clock queries.

use link::{AckResult, Streams, ToDevice};

use crate::settings::{RawForm, with_codes};

/// Streams that the user wants, and the streams that `Start` asks the device for. After a refusal,
/// `Start` asks for fewer.
#[derive(Clone, Debug)]
pub(crate) struct WantedStreams {
    /// Streams that the user wants, with codes added unless packed blocks or features are among
    /// them. ADC samples can be wanted in both forms; the device sends one of these forms.
    wanted: Streams,
    /// Sets of streams to ask the device for, one after the other until it accepts one. Trial is
    /// needed because a refusal does not say which stream the device lacks.
    choices: Vec<Streams>,
    /// Index in `choices` of the set that `Start` asks for at present.
    asked: usize,
}

impl WantedStreams {
    pub(crate) fn new(streams: Streams) -> WantedStreams {
        let wanted = with_codes(streams);
        WantedStreams { wanted, choices: choices(wanted), asked: 0 }
    }

    /// Wants exactly these streams: adds no codes, and does not ask for fewer after a refusal.
    pub(crate) fn alone(streams: Streams) -> WantedStreams {
        WantedStreams { wanted: streams, choices: vec![streams], asked: 0 }
    }

    /// Asks for all wanted streams again, because the device may be another one.
    pub(crate) fn ask_for_all(&mut self) {
        self.asked = 0;
    }

    /// Returns the streams that `Start` asks for at present.
    pub(crate) fn asked(&self) -> Streams {
        self.choices[self.asked]
    }

    /// Returns the streams that the user wants but the device refused.
    pub(crate) fn refused(&self) -> Streams {
        let asked = self.asked();
        let refused = self.wanted.without(asked);
        if RawForm::any_in(asked) { refused.without(RawForm::Any.streams()) } else { refused }
    }

    /// Chooses the next set of streams after a refused `Start`. Returns false if there is none.
    pub(crate) fn ask_for_fewer(&mut self) -> bool {
        let has_fewer = self.asked + 1 < self.choices.len();
        self.asked += usize::from(has_fewer);
        has_fewer
    }
}

/// Returns the sets of streams to ask the device for, best first: each choice of encoders with each
/// choice of samples, and the same sets without features, which older firmware lacks. Then codes
/// alone, because firmware before 0.2 has no other stream. Last come packed blocks in place of
/// codes, for a device without the network.
fn choices(wanted: Streams) -> Vec<Streams> {
    let without_features = with_codes(wanted.without(Streams::FEATURES));
    let both = [wanted, without_features];
    let with_encoders = both.into_iter().flat_map(encoder_choices);
    let without_network = both.map(|wanted| wanted.without(Streams::CODES) | Streams::PACKED);
    let mut choices = Vec::new();
    for streams in with_encoders
        .flat_map(sample_choices)
        .chain([Streams::CODES])
        .chain(without_network.into_iter().flat_map(sample_choices))
    {
        if !choices.contains(&streams) {
            choices.push(streams);
        }
    }
    choices
}

/// Returns the variants of `wanted` to try, one for each kind of device: with network and packed
/// code; with the packed code only, so without codes; with the network only, so with codes but
/// without packed blocks.
fn encoder_choices(wanted: Streams) -> Vec<Streams> {
    if !wanted.contains(Streams::PACKED) {
        return vec![wanted];
    }
    vec![wanted, wanted.without(Streams::CODES), wanted.without(Streams::PACKED) | Streams::CODES]
}

/// Returns variants of `wanted`, one for each speed of the port, fastest first: with plain ADC
/// samples; with compressed ones; with filtered steps, no ADC samples; without samples and steps.
fn sample_choices(wanted: Streams) -> [Streams; 4] {
    let [raw, compressed] = [Streams::RAW, Streams::COMPRESSED_RAW];
    let first = if wanted.contains(raw) { wanted.without(compressed) } else { wanted };
    let filtered = wanted.without(RawForm::Any.streams());
    [first, wanted.without(raw), filtered, filtered.without(Streams::FILTERED)]
}

/// Time from the start of a stream to the first clock query, microseconds. The clock needs this
/// time for its fit, with which the answer is compared.
const FIRST_US: i64 = 1_000_000;
/// Time between two clock queries, microseconds.
const INTERVAL_US: i64 = 10_000_000;
/// Number of clock queries before a restarted device streams again.
const BEFORE_START: u8 = 5;
/// Time after which a clock query before `Start` counts as lost, microseconds. This is longer than
/// a round trip over a USB serial converter, which can hold bytes back for 16 ms.
const LOST_AFTER_US: i64 = 100_000;

/// Schedule of the clock queries. A lost query is not repeated; the next one follows after 10 s.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ClockQuery {
    /// Host time at which the next clock query is due, microseconds; `None` before any stream.
    due_us: Option<i64>,
    /// Sequence number of the newest clock query, and its host time in microseconds.
    sent: Option<(u32, i64)>,
    /// Whether the device has refused a clock query, as older firmware does. If so, it gets no more
    /// queries.
    refused: bool,
    /// Number of clock queries still to be sent before the stream starts.
    before_start: u8,
    /// Whether the newest clock query is unanswered.
    unanswered: bool,
}

impl ClockQuery {
    /// Records that a stream has started. The first clock query follows 1 s after the first start.
    pub(crate) fn start(&mut self, now_us: i64) {
        self.due_us.get_or_insert(now_us + FIRST_US);
    }

    /// Requests clock queries, to be sent before the next stream starts.
    pub(crate) fn query_before_start(&mut self) {
        self.before_start = BEFORE_START;
    }

    /// Returns whether the stream must wait for a clock query that is due or unanswered.
    pub(crate) fn precedes_start(&self, now_us: i64) -> bool {
        !self.refused && (self.before_start > 0 || self.is_awaited(now_us))
    }

    fn is_awaited(&self, now_us: i64) -> bool {
        let is_recent = |(_, sent_us): (u32, i64)| now_us < sent_us + LOST_AFTER_US;
        self.unanswered && self.sent.is_some_and(is_recent)
    }

    /// Returns the next of the clock queries that precede the stream's start; `None` while one is
    /// unanswered. The caller must send it in frame number `seq`.
    pub(crate) fn next_before_start(&mut self, now_us: i64, seq: u32) -> Option<ToDevice<'static>> {
        if self.refused || self.is_awaited(now_us) {
            return None;
        }
        self.before_start = self.before_start.checked_sub(1)?;
        Some(self.query(now_us, seq))
    }

    /// Returns the clock query of a running stream if it is due. The caller must send it in frame
    /// number `seq`.
    pub(crate) fn next(&mut self, now_us: i64, seq: u32) -> Option<ToDevice<'static>> {
        if self.refused || self.due_us? > now_us {
            return None;
        }
        self.due_us = Some(now_us + INTERVAL_US);
        Some(self.query(now_us, seq))
    }

    fn query(&mut self, now_us: i64, seq: u32) -> ToDevice<'static> {
        self.sent = Some((seq, now_us));
        self.unanswered = true;
        let host_time_us = now_us.unsigned_abs();
        ToDevice::SyncTime { host_time_us }
    }

    /// Returns the host time of the newest clock query, microseconds; `None` if none was sent.
    pub(crate) fn sent_us(&self) -> Option<i64> {
        self.sent.map(|(_, host_us)| host_us)
    }

    /// Returns whether an acknowledgement of frame number `of` belongs to the newest clock query.
    /// If it does, records whether the device refused the query.
    pub(crate) fn handle_ack(&mut self, of: u32, result: AckResult) -> bool {
        let is_query = self.sent.is_some_and(|(seq, _)| seq == of);
        self.refused |= is_query && !matches!(result, AckResult::Done | AckResult::Busy);
        self.unanswered &= !is_query;
        is_query
    }
}
