//! What a channel makes of nothing.

use crate::gain::Gain;
use crate::limits::{Limits, SelfTestFault};
use crate::rate::Rate;
use crate::statistics::{Statistics, rms};

/// Judges one channel by its samples with shorted input. The data sheet takes 1000 (8.1); at most
/// 2^16 count.
#[derive(Clone, Debug)]
pub struct ShortedTest {
    gain: Gain,
    statistics: Statistics,
}

/// What a channel makes of a shorted input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShortedResult {
    /// Mean, uV at the input.
    pub offset_uv: f32,
    /// Around the mean, uV rms at the input.
    pub noise_uv: f32,
    /// Samples that were used.
    pub samples: u32,
}

impl ShortedTest {
    /// Before the first sample.
    pub const fn new(gain: Gain) -> Self {
        Self {
            gain,
            statistics: Statistics::around(0),
        }
    }

    /// Takes the next sample, counts, |count| <= 2^23.
    pub fn push(&mut self, count: i32) {
        self.statistics.push(count);
    }

    /// What has been found so far.
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
    /// Whether the channel is in order.
    ///
    /// # Errors
    /// The first limit that does not hold.
    pub fn check(&self, gain: Gain, rate: Rate) -> Result<(), SelfTestFault> {
        let limits = Limits::new(gain, rate);
        limits.samples(self.samples)?;
        limits.offset(self.offset_uv)?;
        limits.noise(self.noise_uv)
    }
}
