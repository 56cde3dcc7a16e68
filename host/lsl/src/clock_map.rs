//! The host's monotonic clock mapped to liblsl's clock.

use std::collections::VecDeque;

use bridge_core::HostTime;

/// Least change of the offset between the clocks, from one reading to the next, that counts as a
/// suspension of the host, microseconds. Without a suspension the offset changes by a few
/// microseconds at most.
const LEAST_SLEEP_US: f64 = 1_000.0;
/// Largest number of segments that are stored. Old segments are needed for samples that have waited
/// in the device or in a queue for minutes.
const MOST_SEGMENTS: usize = 16;
/// Number of readings of both clocks in a row. The reading that took the least time is used.
const READINGS: usize = 3;

/// Maps the host's monotonic clock to liblsl's clock.
///
/// The host's clock runs while the machine is suspended; liblsl's clock (`std::steady_clock`,
/// CLOCK_MONOTONIC on Linux) does not. A new segment begins after each suspension. Times between
/// the last reading before a suspension, up to 0.1 s earlier, and the first reading after it are
/// interpolated, so the map is monotone and has no jump.
#[derive(Clone, Debug, Default)]
pub(crate) struct ClockMap {
    segments: VecDeque<Segment>,
}

/// A period without suspension.
#[derive(Clone, Copy, Debug)]
struct Segment {
    /// Host times of the period's first and newest reading, microseconds.
    read_us: [i64; 2],
    /// liblsl's time minus the host's time, microseconds.
    offset: f64,
}

impl ClockMap {
    /// Reads both clocks; `lsl_clock` returns liblsl's time in seconds.
    pub(crate) fn read(&mut self, lsl_clock: impl Fn() -> f64) {
        let reading = || {
            let before = HostTime::now().monotonic_us;
            let lsl_us = lsl_clock() * 1e6;
            let after = HostTime::now().monotonic_us;
            (after - before, before + (after - before) / 2, lsl_us)
        };
        let readings = std::iter::repeat_with(reading).take(READINGS);
        if let Some((_, host_us, lsl_us)) = readings.min_by_key(|(took, ..)| *took) {
            self.observe(host_us, lsl_us);
        }
    }

    /// Records the times of both clocks at one instant, microseconds.
    #[expect(clippy::cast_precision_loss, reason = "below 2^53 us (285 years)")]
    fn observe(&mut self, host_us: i64, lsl_us: f64) {
        let offset_us = lsl_us - host_us as f64;
        if let Some(newest) = self.segments.back_mut()
            && (newest.offset - offset_us).abs() < LEAST_SLEEP_US
        {
            newest.read_us[1] = host_us;
            newest.offset = offset_us;
            return;
        }
        if self.segments.len() == MOST_SEGMENTS {
            self.segments.pop_front();
        }
        self.segments.push_back(Segment { read_us: [host_us; 2], offset: offset_us });
    }

    /// Converts the host time `host_us`, microseconds, to liblsl's time, seconds; `None` before the
    /// first reading.
    pub(crate) fn lsl_s(&self, host_us: f64) -> Option<f64> {
        let mut later: Option<&Segment> = None;
        for segment in self.segments.iter().rev() {
            if let Some(lsl_us) = segment.lsl_us(host_us, later) {
                return Some(lsl_us * 1e-6);
            }
            later = Some(segment);
        }
        later.map(|first| (host_us + first.offset) * 1e-6)
    }

    /// Converts liblsl's time, seconds, to the host's time, microseconds, with the newest offset;
    /// `None` before the first reading.
    pub(crate) fn host_us(&self, lsl_s: f64) -> Option<f64> {
        Some(lsl_s * 1e6 - self.segments.back()?.offset)
    }
}

impl Segment {
    /// Converts `host_us` to liblsl's time, both microseconds; `None` if `host_us` is before this
    /// segment. `later` is the next segment.
    #[expect(clippy::cast_precision_loss, reason = "below 2^53 us (285 years)")]
    fn lsl_us(&self, host_us: f64, later: Option<&Segment>) -> Option<f64> {
        let [from_us, to_us] = self.read_us.map(|us| us as f64);
        if host_us < from_us {
            return None;
        }
        let Some(later) = later.filter(|_| host_us > to_us) else {
            return Some(host_us + self.offset);
        };
        let end_us = later.read_us[0] as f64;
        let part = (host_us - to_us) / (end_us - to_us);
        let [at_start, at_end] = [to_us + self.offset, end_us + later.offset];
        Some(at_start + part * (at_end - at_start))
    }
}

#[cfg(test)]
#[expect(clippy::cast_precision_loss, reason = "small whole numbers")]
mod tests {
    use super::*;

    fn close(found: Option<f64>, expected: f64) {
        let found = found.expect("a reading");
        assert!((found - expected).abs() < 1e-9, "{found} != {expected}");
    }

    #[test]
    fn times_before_during_and_after_a_suspension_have_their_own_difference() {
        let mut map = ClockMap::default();
        assert_eq!(map.lsl_s(0.0), None);
        // Both clocks run; the host's is 5 s ahead.
        for host_us in (10_000_000..20_000_000).step_by(100_000) {
            map.observe(host_us, (host_us - 5_000_000) as f64 + 0.5);
        }
        close(map.lsl_s(12e6), 7.000_000_5);
        close(map.host_us(7.000_000_5), 12e6);
        // The host sleeps for an hour, from 60 ms after a reading to 40 ms before the next one.
        let woken_us = 19_900_000 + 3_600_000_000 + 100_000;
        map.observe(woken_us, 15_000_000.5);
        close(map.lsl_s(19.9e6), 14.900_000_5);
        close(map.lsl_s(woken_us as f64), 15.000_000_5);
        close(map.lsl_s((19_900_000 + woken_us) as f64 / 2.0), 14.950_000_5);
        close(map.lsl_s(woken_us as f64 + 2e6), 17.000_000_5);
        // A sample from before the first reading.
        close(map.lsl_s(9e6), 4.000_000_5);
        // liblsl's time never goes back.
        let times = (0..400).map(|i| map.lsl_s(19e6 + f64::from(i) * 10e6));
        assert!(times.collect::<Vec<_>>().is_sorted());
    }

    #[test]
    fn suspensions_are_kept_in_bounded_number() {
        let mut map = ClockMap::default();
        for sleep in 0..40 {
            map.observe(sleep * 10_000_000, (sleep * 1_000_000) as f64);
        }
        assert_eq!(map.segments.len(), MOST_SEGMENTS);
        close(map.lsl_s(390e6), 39.0);
        close(map.lsl_s(380e6), 38.0);
    }

    #[test]
    fn both_clocks_are_read_at_the_same_instant() {
        let mut map = ClockMap::default();
        let clock = || HostTime::now().monotonic_us as f64 * 1e-6 - 3.0;
        map.read(clock);
        let now = HostTime::now().monotonic_us as f64;
        let error = map.lsl_s(now).expect("a reading") - (now * 1e-6 - 3.0);
        assert!(error.abs() < 1e-3, "{error}");
    }
}
