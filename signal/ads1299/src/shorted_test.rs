//! Self-test of a channel with shorted input.

use crate::gain::Gain;
use crate::limits::{Limits, SelfTestFault};
use crate::rate::Rate;
use crate::statistics::{Statistics, rms};

/// Measures offset and noise of one channel with shorted input. The data sheet (section 8.1) uses
/// 1000 samples; samples after the first 2^16 are ignored.
#[derive(Clone, Debug)]
pub struct ShortedTest {
    gain: Gain,
    statistics: Statistics,
}

/// Offset and noise of a channel with shorted input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShortedResult {
    /// Mean of the samples, in microvolts at the input.
    pub offset_uv: f32,
    /// Noise around the mean, in microvolts rms at the input.
    pub noise_uv: f32,
    /// Number of samples that the result is computed from.
    pub samples: u32,
}

impl ShortedTest {
    /// Creates a test without samples.
    pub const fn new(gain: Gain) -> Self {
        Self {
            gain,
            statistics: Statistics::around(0),
        }
    }

    /// Adds a sample, in ADC counts, |count| <= 2^23.
    pub fn add_sample(&mut self, count: i32) {
        self.statistics.add(count);
    }

    /// Returns the result over all samples so far.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "results in f32 for the wire"
    )]
    pub fn result(&self) -> ShortedResult {
        let lsb = self.gain.lsb_uv();
        let samples = self.statistics.number();
        ShortedResult {
            offset_uv: (self.statistics.mean() * lsb) as f32,
            noise_uv: (rms(self.statistics.spread(), samples) * lsb) as f32,
            samples,
        }
    }
}

impl ShortedResult {
    /// Checks the result against the [`Limits`] of this gain and rate.
    ///
    /// # Errors
    /// The first limit that is exceeded.
    pub fn check(&self, gain: Gain, rate: Rate) -> Result<(), SelfTestFault> {
        let limits = Limits::new(gain, rate);
        limits.samples(self.samples)?;
        limits.offset(self.offset_uv)?;
        limits.noise(self.noise_uv)
    }
}
