//! The clock of the acquisition's amplifier: the time at which each of its samples was made.

use std::collections::VecDeque;

use bridge_core::{Clock, HostTime};

/// The clock that the amplifier's sample counter is, fitted to the arrivals of frames.
///
/// A nominal time is the index of a sample divided by the rate that the acquisition states,
/// microseconds. The amplifier's true rate differs from it, and the amplifier can pause.
#[derive(Clone, Debug, Default)]
pub(crate) struct AmplifierClock {
    /// Fit of the nominal times to the host's clock, on which no time passes during pauses.
    fit: Clock,
    /// Pauses after the newest sample that was asked for, oldest first: the nominal time of the
    /// first sample after the pause, and the sum of all pauses up to it, microseconds.
    pauses: VecDeque<(u64, i64)>,
    /// Sum of all pauses before the newest sample that was asked for, microseconds.
    before_us: i64,
    /// Sum of all pauses, microseconds.
    paused_us: i64,
    newest: Option<HostTime>,
}

impl AmplifierClock {
    /// Adds a frame to the fit, by the nominal time at its end and its arrival.
    pub(crate) fn observe(&mut self, end_us: u64, read: HostTime) {
        self.newest = Some(read);
        self.fit.observe(end_us, later(read, -self.paused_us));
    }

    /// Notes that the acquisition has paused before the frame with these nominal times at its
    /// beginning and end, which arrived at `read`. Returns the length of the pause, microseconds.
    pub(crate) fn pause(&mut self, start_us: u64, end_us: u64, read: HostTime) -> i64 {
        let expected_us = self.fitted_us(end_us) + self.paused_us;
        let pause_us = (read.monotonic_us - expected_us).max(0);
        self.paused_us += pause_us;
        self.pauses.push_back((start_us, self.paused_us));
        pause_us
    }

    /// Returns the arrival of the newest frame.
    pub(crate) fn newest(&self) -> Option<HostTime> {
        self.newest
    }

    /// Returns the host time at the nominal time `at_us`; `None` before the first frame. Each call
    /// must be for the same or a later nominal time than the call before.
    pub(crate) fn host_time(&mut self, at_us: u64) -> Option<HostTime> {
        let newest = self.newest?;
        while let Some((_, sum_us)) = self.pauses.pop_front_if(|(start, _)| *start <= at_us) {
            self.before_us = sum_us;
        }
        let host_us = self.fitted_us(at_us) + self.before_us;
        Some(later(newest, host_us - newest.monotonic_us))
    }

    /// Returns the amplifier's rate divided by the rate that the acquisition states, minus 1, in
    /// parts per million; 0 until the fit knows it.
    pub(crate) fn rate_error_ppm(&self) -> f64 {
        -self.fit.drift_ppm()
    }

    /// Returns the host time at the nominal time `at_us` without the pauses, microseconds; 0 before
    /// the first frame.
    fn fitted_us(&self, at_us: u64) -> i64 {
        let host_us = self.fit.host_us(at_us.into()).unwrap_or_default();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "within 2^53 us (285 years)"
        )]
        let host_us = host_us.round() as i64;
        host_us
    }
}

/// Returns the time `us` microseconds later.
fn later(time: HostTime, us: i64) -> HostTime {
    HostTime {
        monotonic_us: time.monotonic_us + us,
        wall_ns: time.wall_ns + us * 1000,
    }
}
