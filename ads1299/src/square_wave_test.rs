//! What a channel makes of the chip's own square wave.

use crate::gain::Gain;
use crate::limits::{Limits, SelfTestFault};
use crate::rate::Rate;
use crate::statistics::{Statistics, rms};
use crate::test_signal::TestSignal;

/// Samples left out on either side of a transition: the sinc filter takes three to settle.
const GUARD: usize = 4;

/// Judges one channel by its samples of the chip's own square wave; a state of 120 bytes, so that
/// 64 channels can be judged at once. At least two periods, about 2 s; at most 2^16 samples count.
#[derive(Clone, Debug)]
pub struct SquareWaveTest {
    gain: Gain,
    /// uV.
    amplitude_uv: f64,
    /// The last samples, in which a transition may show itself.
    recent: [i32; GUARD],
    /// How many of them are good.
    held: usize,
    /// Samples still to be left out.
    skip: usize,
    low: Statistics,
    high: Statistics,
}

/// What a channel makes of the square wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareWaveResult {
    /// Measured amplitude by the set one, less 1; -1 if there is no square wave.
    pub gain_error: f32,
    /// Middle between the levels, uV at the input.
    pub offset_uv: f32,
    /// Around the levels, uV rms at the input.
    pub noise_uv: f32,
    /// Samples that were used.
    pub samples: u32,
}

impl SquareWaveTest {
    /// Before the first sample.
    pub const fn new(gain: Gain, signal: TestSignal) -> Self {
        let amplitude_uv = signal.amplitude.uv();
        #[expect(clippy::cast_possible_truncation, reason = "at most 2^23 / 50 counts")]
        let level = (amplitude_uv / gain.lsb_uv()) as i32;
        Self {
            gain,
            amplitude_uv,
            recent: [0; GUARD],
            held: 0,
            // The filter may be on its way when the samples begin.
            skip: GUARD,
            low: Statistics::around(-level),
            high: Statistics::around(level),
        }
    }

    /// Takes the next sample, counts, |count| <= 2^23.
    pub fn push(&mut self, count: i32) {
        let newest = self.recent[GUARD - 1];
        if self.held > 0 && (newest < 0) != (count < 0) {
            // What is held may be the beginning of the transition.
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
            level.push(oldest);
        } else {
            self.held += 1;
        }
        self.recent.rotate_left(1);
        self.recent[GUARD - 1] = count;
    }

    /// What has been found so far.
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
    /// Whether the channel is in order.
    ///
    /// # Errors
    /// The first limit that does not hold.
    pub fn check(&self, gain: Gain, rate: Rate) -> Result<(), SelfTestFault> {
        let limits = Limits::new(gain, rate);
        limits.samples(self.samples)?;
        limits.gain(self.gain_error)?;
        limits.offset(self.offset_uv)?;
        limits.noise(self.noise_uv)
    }
}
