//! Streams that the bridge wants from a device, and its queries of the device's clock.

use link::{AckResult, Streams, ToDevice};

use crate::settings::{RawForm, with_codes};

/// Streams that the user wants, and those of them that `Start` asks for: fewer after the device
/// refused some.
#[derive(Clone, Debug)]
pub(crate) struct WantedStreams {
    /// Streams that the user requested, with the stream of codes added unless packed blocks are
    /// among them. Samples can be requested in both forms, of which the device sends one.
    wanted: Streams,
    /// Sets of streams to ask for, one after the other until the device accepts one, because a
    /// refusal does not say which stream the device lacks.
    choices: Vec<Streams>,
    /// Index in `choices` of the set that `Start` asks for.
    asked: usize,
}

impl WantedStreams {
    pub(crate) fn new(streams: Streams) -> WantedStreams {
        let wanted = with_codes(streams);
        WantedStreams {
            wanted,
            choices: choices(wanted),
            asked: 0,
        }
    }

    /// Asks for all streams again, because the device may be another one.
    pub(crate) fn ask_for_all(&mut self) {
        self.asked = 0;
    }

    /// Streams that `Start` asks for.
    pub(crate) fn asked(&self) -> Streams {
        self.choices[self.asked]
    }

    /// Streams that the user wants and the device refused.
    pub(crate) fn refused(&self) -> Streams {
        let asked = self.asked();
        let refused = self.wanted.without(asked);
        if RawForm::any_in(asked) {
            refused.without(RawForm::Any.streams())
        } else {
            refused
        }
    }

    /// Asks for the next choice after a refused `Start`. Returns false if that was the last one.
    pub(crate) fn ask_for_fewer(&mut self) -> bool {
        let has_fewer = self.asked + 1 < self.choices.len();
        self.asked += usize::from(has_fewer);
        has_fewer
    }
}

/// Returns the sets of streams to ask for, best first: each choice of encoders with each choice of
/// samples, then codes alone, which firmware before 0.2 is limited to. Last come packed blocks in
/// place of codes, for a device without the network.
fn choices(wanted: Streams) -> Vec<Streams> {
    let with_encoders = encoder_choices(wanted).into_iter().flat_map(sample_choices);
    let without_network = sample_choices(wanted.without(Streams::CODES) | Streams::PACKED);
    let mut choices = Vec::new();
    for streams in with_encoders.chain([Streams::CODES]).chain(without_network) {
        if !choices.contains(&streams) {
            choices.push(streams);
        }
    }
    choices
}

/// Returns `wanted` with the encoders that a device may have: network and packed code; the packed
/// code alone, so without codes; the network alone, so with codes in place of packed blocks.
fn encoder_choices(wanted: Streams) -> Vec<Streams> {
    if !wanted.contains(Streams::PACKED) {
        return vec![wanted];
    }
    vec![
        wanted,
        wanted.without(Streams::CODES),
        wanted.without(Streams::PACKED) | Streams::CODES,
    ]
}

/// Returns `wanted` with the samples that a device's port may be fast enough for: plain raw ones,
/// compressed raw ones, filtered ones without raw ones, none.
fn sample_choices(wanted: Streams) -> [Streams; 4] {
    let [raw, compressed] = [Streams::RAW, Streams::COMPRESSED_RAW];
    let first = if wanted.contains(raw) {
        wanted.without(compressed)
    } else {
        wanted
    };
    let filtered = wanted.without(RawForm::Any.streams());
    [
        first,
        wanted.without(raw),
        filtered,
        filtered.without(Streams::FILTERED),
    ]
}

/// Delay from the start of a stream to the first clock query, microseconds. The fit of the clock,
/// with which the answer is compared, needs this time.
const FIRST_US: i64 = 2_000_000;
/// Time between two clock queries, microseconds.
const INTERVAL_US: i64 = 10_000_000;

/// Schedule of the clock queries. A lost query is not repeated; the next one follows 10 s later.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ClockQuery {
    /// Host time at which the next query is due, microseconds; `None` before the first stream.
    due_us: Option<i64>,
    /// Sequence number and host time, microseconds, of the newest query.
    sent: Option<(u32, i64)>,
    /// Whether the device refused a query, because its firmware is older; no more are sent.
    refused: bool,
}

impl ClockQuery {
    /// Records that a stream has started. The first query follows 2 s after the first start.
    pub(crate) fn start(&mut self, now_us: i64) {
        self.due_us.get_or_insert(now_us + FIRST_US);
    }

    /// Returns the query if it is due. The caller sends it in the frame with number `seq`.
    pub(crate) fn next(&mut self, now_us: i64, seq: u32) -> Option<ToDevice> {
        if self.refused || self.due_us? > now_us {
            return None;
        }
        self.due_us = Some(now_us + INTERVAL_US);
        self.sent = Some((seq, now_us));
        let host_time_us = now_us.unsigned_abs();
        Some(ToDevice::SyncTime { host_time_us })
    }

    /// Host time of the newest query, microseconds.
    pub(crate) fn sent_us(&self) -> Option<i64> {
        self.sent.map(|(_, host_us)| host_us)
    }

    /// Returns whether frame `of` is the newest query, and records whether the device refused it.
    pub(crate) fn handle_ack(&mut self, of: u32, result: AckResult) -> bool {
        let is_query = self.sent.is_some_and(|(seq, _)| seq == of);
        self.refused |= is_query && !matches!(result, AckResult::Done | AckResult::Busy);
        is_query
    }
}
