//! Times of the individual samples of a frame.

use bridge_core::StampPoint;

/// Largest difference between a measured period and the nominal one, as a fraction. The bridge
/// follows clocks that are off by up to 4 %.
const MAX_ERROR: f64 = 0.045;
/// Number of newest measurements of the period, 1 s of frames, whose median is used: some of these
/// measurements are wrong while the fit of the device's clock settles or moves.
const MEASUREMENTS: usize = 15;
/// Shortest time from one sample to the next, seconds.
const LEAST_STEP_S: f64 = 1e-7;
/// Largest step back, seconds, that is hidden: more than a fit of the device's clock steps while it
/// settles. After a larger one, the earlier times were wrong.
const MOST_BACK_S: f64 = 0.1;

/// Estimates the period of a stream's samples from the times of its frames, and returns the time of
/// each sample. All times are microseconds of the host's clock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowTimes {
    point: StampPoint,
    nominal_us: f64,
    /// Ring of the newest measurements of the period; at first, all are the nominal period.
    measured_us: [f64; MEASUREMENTS],
    next: usize,
    previous: Option<Previous>,
}

/// A frame whose times have been computed.
#[derive(Clone, Copy, Debug)]
struct Previous {
    stamp_us: f64,
    rows: usize,
    holds_fillers: bool,
}

impl RowTimes {
    /// Creates an estimator for a stream with this nominal rate. `point` is the point in time to
    /// which stamps refer.
    pub(crate) fn new(rate_hz: u16, point: StampPoint) -> RowTimes {
        let nominal_us = 1e6 / f64::from(rate_hz.max(1));
        RowTimes {
            point,
            nominal_us,
            measured_us: [nominal_us; MEASUREMENTS],
            next: 0,
            previous: None,
        }
    }

    /// Returns the times of the `rows` samples of a frame with this stamp, evenly spaced by the
    /// period measured from the frames so far. The frame itself adds a measurement, unless it
    /// `holds_fillers`: the stamps of fillers divide a gap evenly. If they are closer to each other
    /// than samples at that period, so are the fillers' samples, which end before the next frame.
    pub(crate) fn of_frame(
        &mut self,
        stamp_us: f64,
        rows: usize,
        holds_fillers: bool,
    ) -> impl Iterator<Item = f64> + use<> {
        #[expect(clippy::cast_precision_loss, reason = "some hundred samples")]
        let count = |rows: usize| rows as f64;
        let newest = Previous { stamp_us, rows, holds_fillers };
        let previous = self.previous.replace(newest);
        let measured = previous
            .map(|before| (before, (stamp_us - before.stamp_us) / count(before.rows.max(1))));
        if let Some((before, measured)) = measured
            && !holds_fillers
            && !before.holds_fillers
            // A larger difference is a gap or a step of the clock.
            && (measured / self.nominal_us - 1.0).abs() < MAX_ERROR
        {
            self.measured_us[self.next] = measured;
            self.next = (self.next + 1) % MEASUREMENTS;
        }
        let mut sorted = self.measured_us;
        sorted.sort_by(f64::total_cmp);
        let newest = self.measured_us[(self.next + MEASUREMENTS - 1) % MEASUREMENTS];
        // If the newest measurement is wrong, the median of a second is right. If the fit was wrong
        // for a second and has just found the rate, the newest measurement is right.
        let mut choice = [self.nominal_us, newest, sorted[MEASUREMENTS / 2]];
        choice.sort_by(f64::total_cmp);
        let closer = measured.filter(|(_, measured)| holds_fillers && *measured > 0.0);
        let period_us = closer.map_or(choice[1], |(_, measured)| measured.min(choice[1]));
        let first_us = match self.point {
            StampPoint::First => stamp_us,
            StampPoint::Last | StampPoint::Arrival => {
                stamp_us - period_us * count(rows.saturating_sub(1))
            }
        };
        (0..rows).map(move |row| first_us + period_us * count(row))
    }
}

/// Makes the times of a stream's samples increase, as recorders expect.
///
/// While the fit of the device's clock settles, it can step back by more than a sample's period.
/// The first samples of the next frame would then be earlier than the last ones of the previous
/// frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct IncreasingTimes {
    newest_s: Option<f64>,
}

impl IncreasingTimes {
    /// Moves each of the next samples' times, seconds, that is not after the time before it to just
    /// after that time. Steps back by more than [`MOST_BACK_S`] remain.
    pub(crate) fn apply(&mut self, times_s: &mut [f64]) {
        for time_s in times_s {
            if let Some(newest_s) = self.newest_s
                && *time_s > newest_s - MOST_BACK_S
            {
                *time_s = time_s.max(newest_s + LEAST_STEP_S);
            }
            self.newest_s = Some(*time_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_evenly_spaced_at_the_rate_of_the_frames() {
        // A clock that is 1 % slow, and a gap of 3 s.
        let period_us = 1e6 / 512.0 * 1.01;
        let mut times = RowTimes::new(512, StampPoint::First);
        let mut worst: f64 = 0.0;
        for frame in 0..200 {
            // A gap of 3 s before frame 100, and a step of the fit by 1 ms before frame 150.
            let gap = if frame >= 100 { 3e6 } else { 0.0 } + if frame >= 150 { 1e3 } else { 0.0 };
            let stamp_us = 1e6 + f64::from(frame) * 32.0 * period_us + gap;
            for (time, row) in times.of_frame(stamp_us, 32, false).zip(0_u32..) {
                let error = time - (stamp_us + f64::from(row) * period_us);
                if frame >= 8 {
                    worst = worst.max(error.abs());
                }
                // With fewer than eight measurements, the nominal rate is used.
                assert!(error.abs() < 650.0, "frame {frame}: {error} us");
            }
        }
        assert!(worst < 0.01, "{worst} us");
    }

    #[test]
    fn fillers_end_before_the_next_frame_and_do_not_change_the_rate() {
        let mut times = RowTimes::new(128, StampPoint::First);
        let mut stamp_us = 0.0;
        for frame in 0..60 {
            let is_filler = (20..50).contains(&frame);
            let spacing_us = if is_filler { 60_300.0 } else { 62_500.0 };
            let all = times.of_frame(stamp_us, 8, is_filler).collect::<Vec<_>>();
            // The first filler still follows a frame at the usual distance.
            let period_us = if is_filler && frame > 20 { spacing_us / 8.0 } else { 1e6 / 128.0 };
            assert!((all[7] - all[0] - 7.0 * period_us).abs() < 1e-3, "{frame}");
            stamp_us += spacing_us;
        }
    }

    #[test]
    fn only_samples_that_would_be_early_are_moved_and_a_wrong_time_is_left_behind() {
        let mut increasing = IncreasingTimes::default();
        let mut apply = |times: [f64; 3]| {
            let mut times = times.to_vec();
            increasing.apply(&mut times);
            times
        };
        assert_eq!(apply([1.0, 1.002, 1.004]), [1.0, 1.002, 1.004]);
        // The fit has stepped back by 4 ms.
        let moved = apply([1.002, 1.004, 1.006]);
        assert!(1.004 < moved[0] && moved[0] < moved[1] && moved[1] < 1.004_001, "{moved:?}");
        assert_eq!(moved[2..], [1.006]);
        // A stamp in the future, and the right ones after it.
        assert_eq!(apply([11.0, 11.002, 11.004]), [11.0, 11.002, 11.004]);
        assert_eq!(apply([1.014, 1.016, 1.018]), [1.014, 1.016, 1.018]);
    }

    #[test]
    fn the_stamp_is_that_of_the_chosen_sample() {
        let mut first = RowTimes::new(100, StampPoint::First);
        let mut last = RowTimes::new(100, StampPoint::Last);
        let times = |times: &mut RowTimes| times.of_frame(1e6, 3, false).collect::<Vec<_>>();
        assert_eq!(times(&mut first), [1_000_000.0, 1_010_000.0, 1_020_000.0]);
        assert_eq!(times(&mut last), [980_000.0, 990_000.0, 1_000_000.0]);
    }
}
