//! The board's clock, and the host times of the board's samples.

use super::file::ClockTable;

/// Time between two samples by the converters' clock, microseconds.
const SAMPLE_US: f64 = 1e6 / model::ADC_RATE_HZ as f64;

/// Time of the newest sample, by the host's true time and by the board's clock.
#[derive(Clone, Debug)]
pub(super) struct BoardClock {
    table: ClockTable,
    /// Host time of the newest sample, microseconds since the start of the scenario.
    pub(super) host_us: f64,
    /// Time of that sample by the board's clock, microseconds since boot.
    device_us: f64,
}

impl BoardClock {
    pub(super) fn new(table: ClockTable) -> Self {
        Self { table, host_us: 0.0, device_us: 0.0 }
    }

    /// Returns host microseconds per microsecond of the board's clock at the newest sample.
    pub(super) fn rate(&self) -> f64 {
        let seconds = self.host_us / 1e6;
        let changes = self.table.changes.iter().map(|change| {
            change.ppm * ((seconds - change.at_s) / change.for_s.max(1e-3)).clamp(0.0, 1.0)
        });
        1.0 + (self.table.ppm + changes.sum::<f64>()) * 1e-6
    }

    /// Returns host microseconds per microsecond of the converters' clock.
    pub(super) fn converter_rate(&self) -> f64 {
        self.rate() * (1.0 + self.table.converter_ppm * 1e-6)
    }

    /// Returns the host time of the next sample, microseconds.
    pub(super) fn next_sample_us(&self) -> f64 {
        self.host_us + SAMPLE_US * self.converter_rate()
    }

    pub(super) fn advance(&mut self) {
        let next_us = self.next_sample_us();
        self.device_us += (next_us - self.host_us) / self.rate();
        self.host_us = next_us;
    }

    /// Returns the time by the board's clock at the host time `host_us`, which must be within a few
    /// samples of the newest sample; 0 before the boot.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a clock counts whole microseconds; not negative"
    )]
    pub(super) fn device_us(&self, host_us: f64) -> u64 {
        (self.device_us + (host_us - self.host_us) / self.rate()).max(0.0) as u64
    }

    /// Returns the host time at which the board's clock shows `device_us`, which must be within a
    /// few samples of the newest sample.
    #[expect(clippy::cast_precision_loss, reason = "below 2^53 us (285 years)")]
    pub(super) fn host_us_of(&self, device_us: u64) -> f64 {
        self.host_us + (device_us as f64 - self.device_us) * self.rate()
    }

    /// Restarts the board's clock at the host time `host_us`.
    pub(super) fn reboot(&mut self, host_us: f64) {
        self.device_us = (self.host_us - host_us) / self.rate();
    }
}
