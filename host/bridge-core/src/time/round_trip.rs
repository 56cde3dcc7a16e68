//! Round trips of clock queries, which bound the constant delay of the stamps.
//!
//! [`Clock`] is fitted to messages in one direction only. Its host times are late by the least
//! delay from a code's last sample to the reading of the code, and codes alone do not reveal how
//! large that delay is. A query bounds the delay, because the device read the query after the host
//! had sent it, and the host read the answer after the device had made it. With the fitted host
//! time H(t) of a device time t:
//!
//! ```text
//! H(answer made) - answer read  <=  stamps late by  <=  H(query read) - query sent
//! ```
//!
//! The difference between the two bounds is the round-trip time less the time inside the device.
//! Half of that difference is the uncertainty of the offset between the clocks.
//!
//! After a restart of the device, the first code can be read much later than the others, and then
//! reveals little about the start of the new run. A query before the stream starts reveals more.
//! Consider a frame that the device makes together with the answer, and that is delayed no more
//! than the earliest codes are. The host reads this frame no later than the time at which it reads
//! the answer plus the upper bound above. This latest time is the first point of the new fit. It is
//! too late by at most the transfer times of two round trips: the shortest before the restart, and
//! the shortest before the start.

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
    /// Upper bound of the time by which stamps were late before the device was restarted,
    /// microseconds; `None` if there was no round trip that gave a bound.
    late_before_us: Option<f64>,
    /// Number of answers that match no clock query or contain impossible times.
    pub(crate) impossible: u64,
}

/// Times of one clock query and its answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoundTrip {
    read: HostTime,
    /// Transfer times of query and answer together, microseconds; excludes the time in the device.
    pub(crate) transit_us: f64,
    /// Lower and upper bound of the time by which stamps are late, microseconds.
    pub(crate) late_us: [f64; 2],
}

impl RoundTrips {
    /// Discards all round trips, because the device was reset or another one was connected. If
    /// `is_same_device`, keeps the bound of the time by which the device's stamps are late.
    pub(crate) fn restart(&mut self, is_same_device: bool) {
        let shortest = shortest(self.recent.iter()).map(|trip| trip.late_us[1]);
        self.late_before_us = shortest.or(self.late_before_us).filter(|_| is_same_device);
        self.recent.clear();
    }

    /// Returns whether an answer that arrives before the stream starts can anchor the clock of the
    /// new run. This needs a bound, from before the restart, of the time by which stamps are late.
    pub(crate) fn can_anchor(&self) -> bool {
        self.late_before_us.is_some()
    }

    /// Records the answer `reading`, which the device made at its time `made_us` and the host read
    /// at `read`. `sent_us` is the host time of the newest query; `None` if none was sent. An
    /// answer before the clock's first observation becomes an anchor of `clock`.
    pub(crate) fn record(
        &mut self,
        sent_us: Option<i64>,
        reading: ClockReading,
        made_us: u64,
        read: HostTime,
        clock: &mut Clock,
    ) {
        let matches_query = |sent: &i64| u64::try_from(*sent) == Ok(reading.host_time_us);
        let answer = sent_us.filter(matches_query).zip(made_us.checked_sub(reading.received_us));
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
        let Some((least, most)) = least.zip(most) else {
            if let Some(late_us) = self.late_before_us {
                clock.anchor(made_us, read.monotonic_us, late_us);
            }
            return;
        };
        self.recent.push_back(RoundTrip { read, transit_us, late_us: [-least, -most] });
        let old = |trip: &RoundTrip| trip.read.monotonic_us < read.monotonic_us - RETENTION_US;
        while self.recent.front().is_some_and(old) {
            self.recent.pop_front();
        }
    }

    /// Returns the round trip with the shortest transfer time in the last minute; `None` if there
    /// was no round trip.
    pub(crate) fn shortest(&self, now: HostTime) -> Option<RoundTrip> {
        let fresh = |trip: &&RoundTrip| trip.read.monotonic_us >= now.monotonic_us - RETENTION_US;
        shortest(self.recent.iter().filter(fresh)).copied()
    }
}

fn shortest<'a>(trips: impl Iterator<Item = &'a RoundTrip>) -> Option<&'a RoundTrip> {
    trips.min_by(|a, b| a.transit_us.total_cmp(&b.transit_us))
}
