//! How long a question to the device and its answer take.
//!
//! The fit of [`Clock`] sees one direction alone: every device time that it gives is late by the
//! least delay from a code's last sample to its reading, and no code can tell by how much. A round
//! trip bounds it. The device read the question after the host had sent it, and the host read the
//! answer after the device had made it; so of the fit's times H(t)
//!
//! ```text
//! H(answer made) - answer read  <=  late by  <=  H(question read) - question sent
//! ```
//!
//! and the two bounds are as far apart as the round trip is long, the device's own part of it taken
//! out. Half of it is what the clocks' offset is known to.

use std::collections::VecDeque;

use link::ClockReading;

use crate::time::clock::Clock;
use crate::time::host_time::HostTime;

/// Readings are kept so long, microseconds.
const RETENTION_US: i64 = 60_000_000;

/// Round trips of the last minute.
#[derive(Clone, Debug, Default)]
pub(crate) struct RoundTrips {
    recent: VecDeque<RoundTrip>,
    /// Answers that fit no request, or with times that cannot be.
    impossible: u64,
}

/// One question and its answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoundTrip {
    read: HostTime,
    /// Microseconds under way, both directions together.
    pub(crate) transit_us: f64,
    /// The least and the most that the fit's times can be late by, microseconds.
    pub(crate) late_us: Option<[f64; 2]>,
}

impl RoundTrips {
    /// Another boot or another device.
    pub(crate) fn clear(&mut self) {
        self.recent.clear();
    }

    /// An answer, made at `made_us`, to what was asked at `sent_us`; none if nothing was asked.
    pub(crate) fn record(
        &mut self,
        sent_us: Option<i64>,
        reading: ClockReading,
        made_us: u64,
        read: HostTime,
        clock: &Clock,
    ) {
        let asked = |sent: &i64| u64::try_from(*sent) == Ok(reading.host_time_us);
        let answer = sent_us
            .filter(asked)
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

    /// The shortest of the last minute.
    pub(crate) fn shortest(&self, now: HostTime) -> Option<RoundTrip> {
        let fresh = |trip: &&RoundTrip| trip.read.monotonic_us >= now.monotonic_us - RETENTION_US;
        let by_length = |a: &&RoundTrip, b: &&RoundTrip| a.transit_us.total_cmp(&b.transit_us);
        self.recent.iter().filter(fresh).min_by(by_length).copied()
    }

    pub(crate) fn impossible(&self) -> u64 {
        self.impossible
    }
}
