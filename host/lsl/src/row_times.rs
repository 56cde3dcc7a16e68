//! Times of the individual samples of a frame.

use bridge_core::StampPoint;

/// Largest difference between a measured period and the nominal one, as a fraction. The bridge
/// follows clocks that are off by up to 4 %.
const MAX_ERROR: f64 = 0.045;
/// Number of newest measurements of the period, 1 s of frames, whose median is used: some of these
/// measurements are wrong while the fit of the device's clock settles or moves.
const MEASUREMENTS: usize = 15;
/// Shortest time from one sample to the next, microseconds. Successive readings of the offset to
/// liblsl's clock differ by less than this, so the times also increase on that clock.
const LEAST_STEP_US: f64 = 10.0;

/// Estimates the period of a stream's samples from the times of its frames, and returns the time of
/// each sample. All times are microseconds of the host's clock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowTimes {
    point: StampPoint,
    nominal_us: f64,
    /// Ring of the newest measurements of the period; at first, all are the nominal period.
    measured_us: [f64; MEASUREMENTS],
    next: usize,
    /// Stamp of the previous frame, and its number of samples; `None` if it held fillers.
    previous: Option<(f64, usize)>,
    /// Time of the newest sample.
    newest_us: f64,
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
            newest_us: f64::NEG_INFINITY,
        }
    }

    /// Returns the times of the `rows` samples of a frame with this stamp, evenly spaced by the
    /// period measured from the frames so far. The frame itself adds a measurement, unless it
    /// `holds_fillers`: the stamps of fillers only divide a gap evenly.
    ///
    /// Times always increase. If the fit of the device's clock has stepped back by more than a
    /// period, this frame would begin before the end of the previous frame; its samples are then
    /// spaced more closely. The last sample keeps its time if the step is shorter than the frame.
    pub(crate) fn of_frame(
        &mut self,
        stamp_us: f64,
        rows: usize,
        holds_fillers: bool,
    ) -> impl Iterator<Item = f64> + use<> {
        #[expect(clippy::cast_precision_loss, reason = "some hundred samples")]
        let count = |rows: usize| rows as f64;
        let newest = (!holds_fillers).then_some((stamp_us, rows));
        let previous = std::mem::replace(&mut self.previous, newest);
        if let Some((before_us, rows_before)) = previous.filter(|_| !holds_fillers) {
            let measured = (stamp_us - before_us) / count(rows_before.max(1));
            // A larger difference is a gap or a step of the clock.
            if (measured / self.nominal_us - 1.0).abs() < MAX_ERROR {
                self.measured_us[self.next] = measured;
                self.next = (self.next + 1) % MEASUREMENTS;
            }
        }
        let mut sorted = self.measured_us;
        sorted.sort_by(f64::total_cmp);
        let newest = self.measured_us[(self.next + MEASUREMENTS - 1) % MEASUREMENTS];
        // If the newest measurement is wrong, the median of a second is right. If the fit was wrong
        // for a second and has just found the rate, the newest measurement is right.
        let mut choice = [self.nominal_us, newest, sorted[MEASUREMENTS / 2]];
        choice.sort_by(f64::total_cmp);
        let mut period_us = choice[1];
        let mut first_us = match self.point {
            StampPoint::First => stamp_us,
            StampPoint::Last | StampPoint::Arrival => {
                stamp_us - period_us * count(rows.saturating_sub(1))
            }
        };
        let last_us = first_us + period_us * count(rows.saturating_sub(1));
        if first_us < self.newest_us + LEAST_STEP_US {
            period_us = ((last_us - self.newest_us) / count(rows.max(1))).max(LEAST_STEP_US);
            first_us = self.newest_us + period_us;
        }
        self.newest_us = first_us + period_us * count(rows.saturating_sub(1));
        (0..rows).map(move |row| first_us + period_us * count(row))
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
    fn fillers_that_stretch_over_a_gap_do_not_change_the_rate() {
        let mut times = RowTimes::new(128, StampPoint::First);
        let mut stamp_us = 0.0;
        for frame in 0..60 {
            let is_filler = (20..50).contains(&frame);
            let all = times.of_frame(stamp_us, 8, is_filler).collect::<Vec<_>>();
            assert!((all[7] - all[0] - 7.0 / 128.0 * 1e6).abs() < 1e-3, "{frame}");
            stamp_us += if is_filler { 60_300.0 } else { 62_500.0 };
        }
    }

    #[test]
    fn times_increase_although_the_fit_steps_back() {
        let period_us = 1e6 / 512.0;
        let mut times = RowTimes::new(512, StampPoint::First);
        let mut all: Vec<f64> = Vec::new();
        for frame in 0..20 {
            // The stamps step back by less than a period, by more than a period, and by more than a
            // frame.
            let step_us = match frame {
                5..10 => 1e3,
                10..15 => 4e3,
                15.. => 80e3,
                _ => 0.0,
            };
            let stamp_us = f64::from(frame) * 32.0 * period_us - step_us;
            all.extend(times.of_frame(stamp_us, 32, false));
        }
        let least = all.windows(2).map(|pair| pair[1] - pair[0]);
        let least = least.fold(f64::INFINITY, f64::min);
        assert!(least > LEAST_STEP_US - 1e-6, "{least} us");
        // In the fifth frame after a step, the last sample has its own time again.
        let last_us = (15.0 * 32.0 - 1.0) * period_us - 4e3;
        assert!((all[15 * 32 - 1] - last_us).abs() < 1e-6);
        let last_us = (20.0 * 32.0 - 1.0) * period_us - 80e3;
        assert!((all[20 * 32 - 1] - last_us).abs() < 1e-6);
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
