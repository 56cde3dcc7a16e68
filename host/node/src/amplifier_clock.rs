//! The clock of the acquisition's amplifier: the time at which each of its samples was made.

use std::collections::VecDeque;

use bridge_core::{Clock, HostTime};

/// The amplifier's count of samples as a clock, and its fit to the arrivals of frames.
///
/// A nominal time is the index of a sample divided by the rate that the acquisition states. The
/// device time is the nominal time, and the pauses before it. All are microseconds.
#[derive(Clone, Debug, Default)]
pub(crate) struct AmplifierClock {
    /// Fit of the device time to the host's clock.
    fit: Clock,
    /// Pauses after the newest sample that was asked for, oldest first: the nominal time of the
    /// first sample after the pause, and the sum of all pauses up to it.
    pauses: VecDeque<(u64, u64)>,
    /// Sum of all pauses before the newest sample that was asked for.
    before_us: u64,
    /// Sum of all pauses.
    paused_us: u64,
    newest: Option<HostTime>,
}

impl AmplifierClock {
    /// Adds a frame to the fit, by the nominal time at its end and its arrival.
    pub(crate) fn observe(&mut self, end_us: u64, read: HostTime) {
        self.newest = Some(read);
        self.fit.observe(end_us + self.paused_us, read);
    }

    /// Notes that the acquisition has paused before the frame with these nominal times at its
    /// beginning and end, which arrived at `read`. Returns the length of the pause, microseconds.
    pub(crate) fn pause(&mut self, start_us: u64, end_us: u64, read: HostTime) -> u64 {
        let expected_us = self.host_us(end_us + self.paused_us);
        let late_us = read
            .monotonic_us
            .saturating_sub(expected_us)
            .max(0)
            .unsigned_abs();
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and within 2^53 us (285 years)"
        )]
        let pause_us = (late_us as f64 * (1.0 + self.rate_error_ppm() * 1e-6)).round() as u64;
        self.paused_us += pause_us;
        self.pauses.push_back((start_us, self.paused_us));
        late_us
    }

    /// Returns the arrival of the newest frame.
    pub(crate) fn newest(&self) -> Option<HostTime> {
        self.newest
    }

    /// Returns the device time at the nominal time `at_us`. Each call must be for the same or a
    /// later nominal time than the call before.
    pub(crate) fn device_us(&mut self, at_us: u64) -> u64 {
        while let Some((_, sum_us)) = self.pauses.pop_front_if(|(start, _)| *start <= at_us) {
            self.before_us = sum_us;
        }
        at_us + self.before_us
    }

    /// Returns the host time at a device time; `None` before the first frame.
    pub(crate) fn host_time(&self, device_us: u64) -> Option<HostTime> {
        let newest = self.newest?;
        let since_us = self.host_us(device_us) - newest.monotonic_us;
        Some(HostTime {
            monotonic_us: newest.monotonic_us + since_us,
            wall_ns: newest.wall_ns + since_us * 1000,
        })
    }

    /// Returns the amplifier's rate divided by the rate that the acquisition states, minus 1, in
    /// parts per million; 0 until the fit knows it.
    pub(crate) fn rate_error_ppm(&self) -> f64 {
        let period = 1.0 + self.fit.drift_ppm() * 1e-6;
        (1.0 / period - 1.0) * 1e6
    }

    /// Returns the host time at a device time, microseconds; 0 before the first frame.
    fn host_us(&self, device_us: u64) -> i64 {
        let host_us = self.fit.host_us(device_us.into()).unwrap_or_default();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "within 2^53 us (285 years)"
        )]
        let host_us = host_us.round() as i64;
        host_us
    }
}
