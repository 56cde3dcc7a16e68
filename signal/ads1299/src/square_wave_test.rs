//! Self-test of a channel with the chip's internal square wave.

use crate::gain::Gain;
use crate::limits::{Limits, SelfTestFault};
use crate::rate::Rate;
use crate::statistics::{Statistics, rms};
use crate::test_signal::TestSignal;

/// Number of samples ignored on either side of a transition; the sinc filter settles in three
/// samples.
const GUARD: usize = 4;

/// Measures gain, offset and noise of one channel from the chip's internal square wave. It needs at
/// least two periods, about 2 s; samples after the first 2^16 are ignored. Its size is 120 bytes, small
/// enough to measure 64 channels at once.
#[derive(Clone, Debug)]
pub struct SquareWaveTest {
    gain: Gain,
    /// Expected amplitude, in microvolts.
    amplitude_uv: f64,
    /// Newest samples, held back because a transition may have started in them.
    recent: [i32; GUARD],
    /// Number of valid samples in `recent`.
    held: usize,
    /// Number of samples still to be ignored.
    skip: usize,
    low: Statistics,
    high: Statistics,
}

/// Gain, offset and noise of a channel at the square wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareWaveResult {
    /// Ratio of the measured to the expected amplitude, minus 1; -1 without a square wave.
    pub gain_error: f32,
    /// Mean of the two levels, in microvolts at the input.
    pub offset_uv: f32,
    /// Noise around the two levels, in microvolts rms at the input.
    pub noise_uv: f32,
    /// Number of samples that the result is computed from.
    pub samples: u32,
}

impl SquareWaveTest {
    /// Creates a test without samples.
    pub const fn new(gain: Gain, signal: TestSignal) -> Self {
        let amplitude_uv = signal.amplitude.uv();
        #[expect(clippy::cast_possible_truncation, reason = "at most 2^23 / 50 counts")]
        let level = (amplitude_uv / gain.lsb_uv()) as i32;
        Self {
            gain,
            amplitude_uv,
            recent: [0; GUARD],
            held: 0,
            // The first samples may be part of a transition.
            skip: GUARD,
            low: Statistics::around(-level),
            high: Statistics::around(level),
        }
    }

    /// Adds a sample, in ADC counts, |count| <= 2^23.
    pub fn add_sample(&mut self, count: i32) {
        let newest = self.recent[GUARD - 1];
        if self.held > 0 && (newest < 0) != (count < 0) {
            // The transition may have started in the samples held back, so they are discarded.
            self.held = 0;
            self.skip = GUARD;
        }
        if self.skip > 0 {
            self.skip -= 1;
            return;
        }
        if self.held == GUARD {
            let oldest = self.recent[0];
            let level = if oldest < 0 {
                &mut self.low
            } else {
                &mut self.high
            };
            level.add(oldest);
        } else {
            self.held += 1;
        }
        self.recent.rotate_left(1);
        self.recent[GUARD - 1] = count;
    }

    /// Returns the result over all samples so far.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "results in f32 for the wire"
    )]
    pub fn result(&self) -> SquareWaveResult {
        let lsb = self.gain.lsb_uv();
        let (low, high) = (self.low.mean(), self.high.mean());
        let both = self.low.number() > 0 && self.high.number() > 0;
        let amplitude_uv = if both { (high - low) / 2.0 * lsb } else { 0.0 };
        let samples = self.low.number() + self.high.number();
        let spread = self.low.spread() + self.high.spread();
        SquareWaveResult {
            gain_error: (amplitude_uv / self.amplitude_uv - 1.0) as f32,
            offset_uv: (f64::midpoint(high, low) * lsb) as f32,
            noise_uv: (rms(spread, samples) * lsb) as f32,
            samples,
        }
    }
}

impl SquareWaveResult {
    /// Checks the result against the [`Limits`] of this gain and rate.
    ///
    /// # Errors
    /// The first limit that is exceeded.
    pub fn check(&self, gain: Gain, rate: Rate) -> Result<(), SelfTestFault> {
        let limits = Limits::new(gain, rate);
        limits.samples(self.samples)?;
        limits.gain(self.gain_error)?;
        limits.offset(self.offset_uv)?;
        limits.noise(self.noise_uv)
    }
}
