//! Round trips of clock queries, which bound the constant delay of the stamps.
//!
//! [`Clock`] is fitted to messages in one direction only. Its host times are late by the least
//! delay from a code's last sample to the reading of the code, and codes alone do not show how
//! large that delay is. A query bounds it, because the device read the query after the host had
//! sent it, and the host read the answer after the device had made it. With the fitted host time
//! H(t) of a device time t:
//!
//! ```text
//! H(answer made) - answer read  <=  stamps late by  <=  H(query read) - query sent
//! ```
//!
//! The difference between the two bounds is the round-trip time less the time inside the device.
//! Half of that difference is the uncertainty of the offset between the clocks.

use std::collections::VecDeque;

use link::ClockReading;

use crate::time::HostTime;
use crate::time::clock::Clock;

/// Age at which a round trip is discarded, microseconds.
const RETENTION_US: i64 = 60_000_000;

/// Round trips of the last minute. A round trip is a clock query and its answer.
#[derive(Clone, Debug, Default)]
pub(crate) struct RoundTrips {
    recent: VecDeque<RoundTrip>,
    /// Number of answers that match no clock query or contain impossible times.
    pub(crate) impossible: u64,
}

/// Times of one clock query and its answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoundTrip {
    read: HostTime,
    /// Transfer times of query and answer together, microseconds; excludes the time in the device.
    pub(crate) transit_us: f64,
    /// Lower and upper bound of the time by which stamps are late, microseconds; `None` if the
    /// clock had no fit yet.
    pub(crate) late_us: Option<[f64; 2]>,
}

impl RoundTrips {
    /// Discards all round trips, because the device was reset or another one was connected.
    pub(crate) fn clear(&mut self) {
        self.recent.clear();
    }

    /// Records the answer `reading`, which the device made at its time `made_us` and the host read
    /// at `read`. `sent_us` is the host time of the newest query; `None` if none was sent.
    pub(crate) fn record(
        &mut self,
        sent_us: Option<i64>,
        reading: ClockReading,
        made_us: u64,
        read: HostTime,
        clock: &Clock,
    ) {
        let matches_query = |sent: &i64| u64::try_from(*sent) == Ok(reading.host_time_us);
        let answer = sent_us
            .filter(matches_query)
            .zip(made_us.checked_sub(reading.received_us));
        let transit_us = answer.map(|(sent_us, inside_us)| {
            #[expect(clippy::cast_precision_loss, reason = "seconds, in microseconds")]
            let us = (i128::from(read.monotonic_us) - i128::from(sent_us) - i128::from(inside_us))
                as f64;
            (sent_us, us)
        });
        let Some((sent_us, transit_us)) = transit_us.filter(|(_, us)| *us >= 0.0) else {
            self.impossible += 1;
            return;
        };
        let least = clock.lag_us(made_us, read.monotonic_us);
        let most = clock.lag_us(reading.received_us, sent_us);
        self.recent.push_back(RoundTrip {
            read,
            transit_us,
            late_us: least.zip(most).map(|(least, most)| [-least, -most]),
        });
        let old = |trip: &RoundTrip| trip.read.monotonic_us < read.monotonic_us - RETENTION_US;
        while self.recent.front().is_some_and(old) {
            self.recent.pop_front();
        }
    }

    /// Returns, of the round trips in the last minute, the one with the shortest transfer time;
    /// `None` if there is none.
    pub(crate) fn shortest(&self, now: HostTime) -> Option<RoundTrip> {
        let fresh = |trip: &&RoundTrip| trip.read.monotonic_us >= now.monotonic_us - RETENTION_US;
        let by_length = |a: &&RoundTrip, b: &&RoundTrip| a.transit_us.total_cmp(&b.transit_us);
        self.recent.iter().filter(fresh).min_by(by_length).copied()
    }
}
