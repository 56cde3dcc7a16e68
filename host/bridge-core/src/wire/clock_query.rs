//! Queries for the device's clock.

use link::{AckResult, ToDevice};

/// Delay from the start of a stream to the first query, microseconds; the clock must be fitted first.
const FIRST_US: i64 = 2_000_000;
/// Time between two queries, microseconds.
const INTERVAL_US: i64 = 10_000_000;

/// State of the clock queries. A lost query is not repeated; the next one follows 10 s later.
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
