//! Device time of the virtual board.

use std::{
    thread,
    time::{Duration, Instant},
};

/// Relation of device time to wall-clock time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Real time: device time follows the wall clock, and samples are processed when they are due.
    Realtime,
    /// Virtual time: device time advances by one period per sample, and samples are processed as
    /// fast as possible.
    Fast,
}

/// Counts samples and computes the device time at which each sample is due.
#[derive(Clone, Debug)]
pub struct DeviceClock {
    pace: Pace,
    rate_hz: u32,
    /// Device seconds per second of the wall clock.
    speed: f64,
    boot: Instant,
    /// Device time of sample 0, microseconds.
    start_us: u64,
    samples: u64,
}

impl DeviceClock {
    /// Creates a clock whose device time starts at 0, for `rate_hz` samples per second. In real
    /// time the clock is fast by `ppm` parts per million, or slow if `ppm` is negative; it must be
    /// above -1,000,000.
    pub fn new(pace: Pace, rate_hz: u32, ppm: f64) -> Self {
        Self {
            pace,
            rate_hz,
            speed: 1.0 + ppm * 1e-6,
            boot: Instant::now(),
            start_us: 0,
            samples: 0,
        }
    }

    /// Returns the device time, microseconds since boot.
    pub fn now_us(&self) -> u64 {
        match self.pace {
            Pace::Realtime => micros(self.boot.elapsed().mul_f64(self.speed)),
            Pace::Fast => self.due_us(self.samples),
        }
    }

    /// Starts sampling now: sets the number of the next sample to 0.
    pub fn start(&mut self) {
        self.start_us = self.now_us();
        self.samples = 0;
    }

    /// Counts the next sample and returns its DRDY time, microseconds of device time. Sample n is
    /// due exactly n / rate after sample 0, even if the thread wakes up late.
    pub fn next_drdy_us(&mut self) -> u64 {
        let due = self.due_us(self.samples);
        self.samples += 1;
        due
    }

    /// Sleeps until the next sample is due; returns at once in virtual time. The deadline is
    /// absolute, so lateness does not accumulate.
    pub fn wait_for_next(&self) {
        if self.pace == Pace::Fast {
            return;
        }
        let due_us = Duration::from_micros(self.due_us(self.samples));
        let due = self.boot + due_us.div_f64(self.speed);
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }

    fn due_us(&self, sample: u64) -> u64 {
        self.start_us + sample * 1_000_000 / u64::from(self.rate_hz)
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_due_exactly_one_period_apart() {
        let mut clock = DeviceClock::new(Pace::Fast, 512, 0.0);
        let due: Vec<u64> = (0..513).map(|_| clock.next_drdy_us()).collect();
        assert_eq!((due[0], due[1], due[32], due[512]), (0, 1_953, 62_500, 1_000_000));
        assert_eq!(clock.now_us(), 1_001_953);
    }

    #[test]
    fn a_clock_that_is_fast_shows_more_time_than_has_passed() {
        let mut clock = DeviceClock::new(Pace::Realtime, 1000, 1e6);
        let before = Instant::now();
        (0..100).for_each(|_| _ = clock.next_drdy_us());
        clock.wait_for_next();
        // Sample 100 is due after 100 ms of device time, which pass in 50 ms of wall-clock time.
        assert!(clock.now_us() >= 100_000);
        assert!(clock.now_us() >= micros(before.elapsed()));
        assert!(before.elapsed() >= Duration::from_millis(49));
    }
}
