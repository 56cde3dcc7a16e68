//! Decides when the bridge stops reading the port until the decoder has caught up.

/// Largest number of windows that may wait for the decoder. If more wait, the bridge stops reading
/// a source that is faster than real time. 256 windows are 16 s of signal and take about 1 s to
/// decode.
const WAITING_WINDOWS: u64 = 256;

/// Lead of the device's time over the host's time, microseconds, above which the source counts as
/// faster than real time.
const AHEAD_US: i64 = 10_000_000;
/// In addition to [`AHEAD_US`], the device's time may be ahead by the elapsed time divided by this
/// number (4 %), so that a fast clock never counts as a source faster than real time. RC
/// oscillators are up to 3 % fast.
const DRIFT: i64 = 25;

/// Finds out whether the source is faster than real time, by comparing the device's time with the
/// host's. Such a source, for example `host-sim run --fast`, waits for its reader and loses nothing
/// when the bridge stops reading. A device in real time cannot wait: its queue holds some seconds.
///
/// A backlog that arrives after a stall does not count as faster than real time, because the host's
/// time went on during the stall.
#[derive(Debug, Default)]
pub struct BackPressure {
    /// Device time and host time of the first code since the device's last restart, microseconds.
    first: Option<(u64, i64)>,
    newest_device_us: u64,
    runs_ahead: bool,
}

impl BackPressure {
    /// Records a code with device time `device_us` that was read at host time `read_us`.
    pub fn record(&mut self, device_us: u64, read_us: i64) {
        if device_us < self.newest_device_us {
            // The device has restarted, so its time began again at 0.
            self.first = None;
        }
        self.newest_device_us = device_us;
        let (first_device_us, first_read_us) = *self.first.get_or_insert((device_us, read_us));
        let device_elapsed_us = i64::try_from(device_us - first_device_us).unwrap_or(i64::MAX);
        let host_elapsed_us = read_us.saturating_sub(first_read_us);
        let limit_us = AHEAD_US.saturating_add(host_elapsed_us / DRIFT);
        self.runs_ahead = device_elapsed_us.saturating_sub(host_elapsed_us) > limit_us;
    }

    /// Returns whether to stop reading the port while `waiting` windows wait for the decoder.
    pub fn must_pause(&self, waiting: u64) -> bool {
        self.runs_ahead && waiting > WAITING_WINDOWS
    }
}

#[cfg(test)]
mod tests {
    use super::{BackPressure, WAITING_WINDOWS};

    const HOP_US: u64 = 62_500;

    #[test]
    fn a_source_faster_than_real_time_waits_while_the_queue_is_long() {
        let mut pressure = BackPressure::default();
        for code in 0..2000 {
            pressure.record(code * HOP_US, 1000);
        }
        assert!(pressure.must_pause(WAITING_WINDOWS + 1));
        assert!(!pressure.must_pause(WAITING_WINDOWS));
    }

    #[test]
    fn a_device_whose_clock_is_fast_by_3_percent_is_in_real_time_after_days() {
        let mut pressure = BackPressure::default();
        for day in 0..30_i64 {
            let host_us = day * 86_400_000_000;
            pressure.record((host_us + host_us * 3 / 100).unsigned_abs(), host_us);
            assert!(!pressure.must_pause(WAITING_WINDOWS + 1), "day {day}");
        }
    }

    #[test]
    fn a_backlog_of_a_stalled_host_is_read_however_long_the_queue_is() {
        let mut pressure = BackPressure::default();
        pressure.record(0, 0);
        // After a stall of 10 minutes, the host reads all codes of that time at once.
        for code in 1..=9600 {
            pressure.record(code * HOP_US, 600_000_000);
            assert!(!pressure.must_pause(code));
        }
    }

    #[test]
    fn a_restart_of_the_device_does_not_count_as_running_ahead() {
        let mut pressure = BackPressure::default();
        pressure.record(900_000_000, 0);
        pressure.record(HOP_US, 100_000);
        assert!(!pressure.must_pause(u64::MAX));
        pressure.record(2 * HOP_US, 162_500);
        assert!(!pressure.must_pause(u64::MAX));
    }
}
