//! The clock of the acquisition's amplifier: the time at which each of its samples was made.

use std::collections::VecDeque;

use bridge_core::{Clock, HostTime};

/// Inverse of the largest relative error of the amplifier's rate that is assumed after the first
/// frame: 1/25 is 4 %. The assumed error falls with each further frame.
const MAX_ERROR: i64 = 25;

/// The amplifier's count of samples, used as a clock and fitted to the arrivals of frames.
///
/// A nominal time is the index of a sample divided by the rate that the acquisition states. The
/// device time is the nominal time plus the pauses before it. All times are in microseconds.
#[derive(Clone, Debug, Default)]
pub(crate) struct AmplifierClock {
    /// Fit of the device time to the host's clock.
    fit: Clock,
    /// Pauses after the newest nominal time for which `device_us` was called, oldest first. Each
    /// entry holds the nominal time of the first sample after the pause, and the sum of all pauses
    /// up to this sample, microseconds.
    pauses: VecDeque<(u64, u64)>,
    /// Sum of all pauses before the newest nominal time for which `device_us` was called,
    /// microseconds.
    before_us: u64,
    /// Sum of all pauses so far.
    paused_us: u64,
    /// Device times at which the newest frame begins and ends, and its arrival.
    newest: Option<([u64; 2], HostTime)>,
    /// Number of frames observed.
    frames: i64,
}

impl AmplifierClock {
    /// Adds a frame to the fit, by its arrival and the nominal times at its beginning and end.
    pub(crate) fn observe(&mut self, start_us: u64, end_us: u64, read: HostTime) {
        let [start_us, end_us] = [start_us, end_us].map(|us| us + self.paused_us);
        self.newest = Some(([start_us, end_us], read));
        self.frames = self.frames.saturating_add(1);
        self.fit.observe(end_us, read);
    }

    /// Notes that the acquisition paused before the frame that has these nominal times at its
    /// beginning and end, and that arrived at `read`. Returns the length of the pause,
    /// microseconds.
    pub(crate) fn pause(&mut self, start_us: u64, end_us: u64, read: HostTime) -> u64 {
        let expected_us = self.host_us(end_us + self.paused_us);
        let late_us = read.monotonic_us.saturating_sub(expected_us).max(0).unsigned_abs();
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and within 2^53 us (285 years)"
        )]
        let pause_us = (late_us as f64 / (1.0 + self.fit.drift_ppm() * 1e-6)).round() as u64;
        self.paused_us += pause_us;
        self.pauses.push_back((start_us, self.paused_us));
        late_us
    }

    /// Returns the arrival of the newest frame.
    pub(crate) fn newest(&self) -> Option<HostTime> {
        self.newest.map(|(_, read)| read)
    }

    /// Returns the device time at the nominal time `at_us`. Each call must be for the same or a
    /// later nominal time than the call before.
    pub(crate) fn device_us(&mut self, at_us: u64) -> u64 {
        while let Some((_, sum_us)) = self.pauses.pop_front_if(|(start, _)| *start <= at_us) {
            self.before_us = sum_us;
        }
        at_us + self.before_us
    }

    /// Returns the host time at a device time; `None` before the first frame. Until the fit has
    /// settled, times in the newest frame follow from the frame's own arrival, because the bridge's
    /// fit ignores a time that is too late, but not a time that is too early.
    pub(crate) fn host_time(&self, device_us: u64) -> Option<HostTime> {
        let ([start_us, end_us], newest) = self.newest?;
        let late_us = if device_us >= start_us && !self.fit.is_settled() {
            newest.monotonic_us - self.host_us(end_us)
        } else {
            0
        };
        // Add the largest error that the rate may cause, which falls with each frame. If the added
        // time fell to 0 at once, the device's clock would appear to be fast at that moment.
        let since_us = i64::try_from(end_us.saturating_sub(device_us)).unwrap_or(i64::MAX);
        let early_us = since_us / MAX_ERROR / self.frames.max(1);
        let since_us = self.host_us(device_us) + late_us + early_us - newest.monotonic_us;
        Some(HostTime {
            monotonic_us: newest.monotonic_us + since_us,
            wall_ns: newest.wall_ns + since_us * 1000,
        })
    }

    /// Returns the host time at a device time, microseconds; 0 before the first frame.
    fn host_us(&self, device_us: u64) -> i64 {
        let host_us = self.fit.host_us(device_us.into()).unwrap_or_default();
        #[expect(clippy::cast_possible_truncation, reason = "within 2^53 us (285 years)")]
        let host_us = host_us.round() as i64;
        host_us
    }
}
