//! Cuts a stream of samples into frames of equal length, and finds gaps by the samples' times.

/// Fraction of a sample's deviation by which the later expected times are corrected. A clock that
/// is off by 1 % then deviates by half a sample, and the jitter within a chunk averages out.
const GAIN: f64 = 0.02;
/// Deviation of a sample's time, seconds, above which samples count as missing before this sample.
/// Programs that stamp whole chunks on arrival cause smaller deviations.
const LEAST_GAP_S: f64 = 0.25;
/// Amount by which the frame numbers jump when the sender restarts.
const RESTART: u32 = 1 << 30;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CutFrame {
    /// Number of the frame. Numbers of missing frames are left out.
    pub(crate) number: u32,
    /// Values, one sample after the other.
    pub(crate) values: Vec<f32>,
    /// End of the last sample's period, seconds, on the clock that the samples' times refer to;
    /// jitter is averaged out.
    pub(crate) end_s: f64,
}

/// Collects samples into frames.
///
/// The Lab Streaming Layer does not number samples, so their times show where samples are missing.
/// Jitter is averaged out. At a gap, the unfinished frame and the samples up to the next frame
/// boundary are discarded, so a frame never holds an invented sample.
#[derive(Clone, Debug)]
pub(crate) struct FrameCutter {
    period_s: f64,
    samples: usize,
    values: Vec<f32>,
    filled: usize,
    number: u32,
    /// Expected time of the next sample, seconds; `None` before the first.
    next_s: Option<f64>,
    /// Number of samples to discard until the next frame begins.
    skipped: usize,
}

impl FrameCutter {
    /// Creates a cutter for samples at `rate_hz`, into frames of `samples` samples.
    pub(crate) fn new(rate_hz: u16, samples: u16) -> FrameCutter {
        FrameCutter {
            period_s: 1.0 / f64::from(rate_hz.max(1)),
            samples: usize::from(samples.max(1)),
            values: Vec::new(),
            filled: 0,
            number: 1,
            next_s: None,
            skipped: 0,
        }
    }

    /// Adds a sample that was measured at `time_s`. Returns the frame that it completes, if any.
    pub(crate) fn push(
        &mut self,
        time_s: f64,
        values: impl Iterator<Item = f32>,
    ) -> Option<CutFrame> {
        let expected_s = self.next_s.unwrap_or(time_s);
        // Use the expected time for a sample without a valid time.
        let time_s = if time_s.is_finite() { time_s } else { expected_s };
        let deviation_s = time_s - expected_s;
        let made_s = if deviation_s > LEAST_GAP_S {
            self.leave_gap(deviation_s);
            time_s
        } else if deviation_s < -LEAST_GAP_S {
            // The times have gone back: the sender has restarted.
            self.number = self.number.wrapping_add(RESTART);
            (self.filled, self.skipped) = (0, 0);
            self.values.clear();
            time_s
        } else {
            expected_s + GAIN * deviation_s
        };
        let next_s = made_s + self.period_s;
        self.next_s = Some(next_s);
        if self.skipped > 0 {
            self.skipped -= 1;
            return None;
        }
        self.values.extend(values);
        self.filled += 1;
        if self.filled < self.samples {
            return None;
        }
        self.filled = 0;
        let frame = CutFrame {
            number: self.number,
            values: std::mem::take(&mut self.values),
            end_s: next_s,
        };
        self.number = self.number.wrapping_add(1);
        Some(frame)
    }

    /// Skips a gap: discards the unfinished frame, and sets how many samples to discard next.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and saturates"
    )]
    fn leave_gap(&mut self, gap_s: f64) {
        let missing = (gap_s / self.period_s).round() as usize;
        // Number of sample positions from the start of the unfinished frame to the new sample.
        let places = (self.filled + self.skipped_places()).saturating_add(missing);
        let frames = places.div_ceil(self.samples);
        self.number = self.number.wrapping_add(u32::try_from(frames).unwrap_or(RESTART));
        self.skipped = frames.saturating_mul(self.samples) - places;
        self.filled = 0;
        self.values.clear();
    }

    /// If a frame is being discarded, returns how many of its sample positions lie before the next
    /// sample, and subtracts the frame from `number`, which already counts it. Otherwise returns 0.
    fn skipped_places(&mut self) -> usize {
        if self.skipped == 0 {
            return 0;
        }
        self.number = self.number.wrapping_sub(1);
        self.samples - self.skipped
    }
}

#[cfg(test)]
#[expect(clippy::cast_precision_loss, clippy::float_cmp, reason = "small whole numbers")]
mod tests {
    use super::*;

    /// Cuts samples of a 100 Hz stream, given by index and error of their time, into frames of 10.
    /// Returns each frame's number and its first value, which is the index of its first sample.
    fn cut(samples: impl Iterator<Item = (u32, f64)>) -> Vec<(u32, f32)> {
        let mut cutter = FrameCutter::new(100, 10);
        let frames = samples.filter_map(|(index, error_s)| {
            let time_s = 50.0 + f64::from(index) / 100.0 + error_s;
            cutter.push(time_s, std::iter::once(index as f32))
        });
        frames
            .map(|frame| {
                assert_eq!(frame.values.len(), 10);
                let steps = frame.values.windows(2).map(|pair| pair[1] - pair[0]);
                assert!(steps.clone().all(|step| step == 1.0), "{frame:?}");
                (frame.number, frame.values[0])
            })
            .collect()
    }

    /// Asserts that each frame's number matches the index of its first sample.
    fn assert_placed(frames: &[(u32, f32)]) {
        for (number, first) in frames {
            assert_eq!((*number - 1) as f32 * 10.0, *first, "{frames:?}");
        }
    }

    #[test]
    fn frames_after_gaps_of_any_length_have_the_number_of_their_place() {
        for (start, length) in [(30, 40), (33, 40), (39, 30), (5, 26), (71, 1234)] {
            let missing = start..start + length;
            let samples = (0..3000).filter(|index| !missing.contains(index));
            let frames = cut(samples.map(|index| (index, 0.0)));
            assert_placed(&frames);
            let around = length.div_ceil(10) + 1;
            assert!(frames.len() >= 300 - around as usize, "{}", frames.len());
        }
        // Two gaps in a row, of which the second begins while samples are discarded.
        let samples = (0..600).filter(|i| !(33..70).contains(i) && !(73..111).contains(i));
        assert_placed(&cut(samples.map(|index| (index, 0.0))));
    }

    #[test]
    fn jitter_and_a_wrong_rate_are_no_gap() {
        // All 20 samples of a chunk have the time of the chunk's last sample; the clock is 1 % off.
        let samples = (0..5000_u32).map(|index| {
            let chunk_s = f64::from(19 - index % 20) / 100.0;
            (index, chunk_s + f64::from(index) * 1e-4)
        });
        let frames = cut(samples);
        assert_eq!(frames.len(), 500);
        assert_placed(&frames);
    }

    #[test]
    fn the_end_of_a_frame_has_less_jitter_than_its_samples() {
        let (mut cutter, mut hash) = (FrameCutter::new(512, 32), 1_u32);
        let mut worst: f64 = 0.0;
        for index in 0..20_000_u32 {
            hash = hash.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Each sample's time is up to 1 ms early or late, and the sender's clock is 200 ppm
            // fast.
            let error_s = 2e-3 * (f64::from(hash >> 8) / f64::from(1 << 24) - 0.5);
            let made_s = f64::from(index) / 512.0 / 1.000_2;
            let Some(frame) = cutter.push(made_s + error_s, std::iter::once(0.0)) else {
                continue;
            };
            if index > 512 {
                worst = worst.max((frame.end_s - made_s - 1.0 / 512.0).abs());
            }
        }
        assert!(worst < 0.25e-3, "{worst} s");
    }

    #[test]
    fn times_that_go_back_are_a_restart() {
        let samples = (0..100_u32).map(|index| (index, if index < 55 { 0.0 } else { -30.0 }));
        let frames = cut(samples);
        assert_eq!(frames[4], (5, 40.0));
        assert_eq!(frames[5], (6 + RESTART, 55.0));
    }
}
