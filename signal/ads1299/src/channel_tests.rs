//! Tests of a channel with the internal signals of its chip: a square wave, and shorted inputs.

use crate::limits::{SelfTestFault, check_gain, check_noise, check_offset, check_samples};
use crate::settings::{Gain, Rate, TEST_AMPLITUDE_UV};

/// Number of samples ignored before and after a transition of the square wave; the chip's sinc
/// filter settles in three samples.
const GUARD: usize = 4;

/// Measures gain, offset and noise of one channel from the chip's internal square wave. It needs at
/// least two periods, about 2 s; samples after the first 2^16 are ignored. One test takes 80
/// bytes on a microcontroller, so that 64 channels can be measured at once.
#[derive(Clone, Debug)]
pub struct SquareWaveTest {
    gain: Gain,
    /// Newest samples, held back because a transition may have started in them.
    recent: [i32; GUARD],
    /// Number of valid samples in `recent`.
    held: usize,
    /// Number of samples still to be ignored, because they may be part of a transition.
    skip: usize,
    low: Statistics,
    high: Statistics,
}

/// Gain error, offset and noise of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelResult {
    /// Ratio of the measured to the expected amplitude, minus 1; -1 without a square wave; 0 if the
    /// input is shorted, because the gain is not measured then.
    pub gain_error: f32,
    /// Mean of the samples, or of the square wave's two levels, in microvolts at the input.
    pub offset_uv: f32,
    /// Noise around the mean or the square wave's two levels, in microvolts rms at the input.
    pub noise_uv: f32,
    /// Number of samples that the result is computed from.
    pub samples: u32,
}

impl SquareWaveTest {
    /// Creates a test without samples.
    pub const fn new(gain: Gain) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "at most 2^23 / 50 counts")]
        let level = (TEST_AMPLITUDE_UV / gain.lsb_uv()) as i32;
        Self {
            gain,
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
            let level = if oldest < 0 { &mut self.low } else { &mut self.high };
            level.add(oldest);
        } else {
            self.held += 1;
        }
        self.recent.rotate_left(1);
        self.recent[GUARD - 1] = count;
    }

    /// Returns gain error, offset and noise, computed from all samples so far.
    #[expect(clippy::cast_possible_truncation, reason = "results in f32 for the wire")]
    pub fn result(&self) -> ChannelResult {
        let lsb = self.gain.lsb_uv();
        let (low, high) = (self.low.mean(), self.high.mean());
        let both = self.low.number() > 0 && self.high.number() > 0;
        let amplitude_uv = if both { (high - low) / 2.0 * lsb } else { 0.0 };
        let samples = self.low.number() + self.high.number();
        let spread = self.low.spread() + self.high.spread();
        ChannelResult {
            gain_error: (amplitude_uv / TEST_AMPLITUDE_UV - 1.0) as f32,
            offset_uv: (f64::midpoint(high, low) * lsb) as f32,
            noise_uv: (rms(spread, samples) * lsb) as f32,
            samples,
        }
    }
}

impl ChannelResult {
    /// Checks the result against the limits of a working channel at this gain and rate.
    ///
    /// # Errors
    /// The first limit that is exceeded.
    pub fn check(&self, gain: Gain, rate: Rate) -> Result<(), SelfTestFault> {
        check_samples(self.samples)?;
        check_gain(self.gain_error)?;
        check_offset(self.offset_uv)?;
        check_noise(self.noise_uv, gain, rate)
    }
}

/// Measures offset and noise of one channel with shorted input. The data sheet (section 8.1) uses
/// 1000 samples; samples after the first 2^16 are ignored.
#[derive(Clone, Debug)]
pub struct ShortedTest {
    gain: Gain,
    statistics: Statistics,
}

impl ShortedTest {
    /// Creates a test without samples.
    pub const fn new(gain: Gain) -> Self {
        Self { gain, statistics: Statistics::around(0) }
    }

    /// Adds a sample, in ADC counts, |count| <= 2^23.
    pub fn add_sample(&mut self, count: i32) {
        self.statistics.add(count);
    }

    /// Returns offset and noise, computed from all samples so far.
    #[expect(clippy::cast_possible_truncation, reason = "results in f32 for the wire")]
    pub fn result(&self) -> ChannelResult {
        let lsb = self.gain.lsb_uv();
        let samples = self.statistics.number();
        ChannelResult {
            gain_error: 0.0,
            offset_uv: (self.statistics.mean() * lsb) as f32,
            noise_uv: (rms(self.statistics.spread(), samples) * lsb) as f32,
            samples,
        }
    }
}

/// Running sums for mean and variance of samples, in counts. Each sample is clipped to within 2^23
/// of the reference, so the sums over 2^16 samples are exact in 64 bits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Statistics {
    reference: i32,
    number: u32,
    sum: i64,
    squares: u64,
}

impl Statistics {
    /// Largest number of samples that the sums take; further samples are ignored.
    const MOST: u32 = 1 << 16;

    /// Creates empty sums; `reference` should be near the mean.
    pub(crate) const fn around(reference: i32) -> Self {
        Self { reference, number: 0, sum: 0, squares: 0 }
    }

    /// Adds a sample, in counts, |count| <= 2^23.
    pub(crate) fn add(&mut self, count: i32) {
        if self.number == Self::MOST {
            return;
        }
        let distance = i64::from(count) - i64::from(self.reference);
        let distance = distance.clamp(-(1 << 23), 1 << 23);
        self.number += 1;
        self.sum += distance;
        self.squares += distance.unsigned_abs().pow(2);
    }

    pub(crate) const fn number(&self) -> u32 {
        self.number
    }

    /// Returns the mean in counts; the reference if no sample has been added.
    #[expect(clippy::cast_precision_loss, reason = "|sum| <= 2^39 is exact")]
    pub(crate) fn mean(&self) -> f64 {
        f64::from(self.reference) + self.sum as f64 / f64::from(self.number.max(1))
    }

    /// Returns the sum of squared deviations from the mean, in counts^2.
    #[expect(clippy::cast_precision_loss, reason = "15 digits of a spread suffice")]
    pub(crate) fn spread(&self) -> f64 {
        let sum = self.sum as f64;
        (self.squares as f64 - sum * sum / f64::from(self.number.max(1))).max(0.0)
    }
}

/// Returns the standard deviation in counts, with a resolution of 1/65536 count below 1 mV at gain
/// 24, and of 1 count above. Uses the integer square root, because `core` has no square root for
/// floats.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a variance of at most 2^46 times 2^32 saturates, and is far beyond any limit then"
)]
pub(crate) fn rms(spread: f64, number: u32) -> f64 {
    let variance = spread / f64::from(number.max(1));
    let scale = 65536.0;
    // 2^31 counts^2 is the variance at 1 mV rms and gain 24. Below that, the scaled variance fits
    // into 64 bits.
    if variance < 2_147_483_648.0 {
        ((variance * scale * scale) as u64).isqrt() as f64 / scale
    } else {
        (variance as u64).isqrt() as f64
    }
}
