//! Random numbers and low-pass noise.

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};

/// A stream of random numbers from ChaCha8, equal for equal seeds.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    random: ChaCha8Rng,
}

impl Noise {
    /// Creates the random stream with the number `stream`. The streams of one `seed` are
    /// independent of each other.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        Self { random }
    }

    /// Returns a number of mean 0 and variance 1, |x| <= 3.47: the scaled sum of four uniform
    /// 16-bit numbers. This is close to a normal distribution and does not need the logarithm of
    /// the Box-Muller method.
    pub(super) fn normal(&mut self) -> f64 {
        let bits = self.random.next_u64();
        let [a, b, c, d, e, f, g, h] = bits.to_le_bytes();
        let parts = [[a, b], [c, d], [e, f], [g, h]];
        let sum: u32 = parts.iter().map(|part| u32::from(u16::from_le_bytes(*part))).sum();
        // Subtract the mean, `4 * 65535 / 2`, and divide by the root of the variance,
        // `4 * (65536^2 - 1) / 12`.
        (f64::from(sum) - 131_070.0) / 37_837.227_2
    }

    /// Returns a uniformly distributed number in `low..high`.
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (f64::from(self.random.next_u32()) / 4_294_967_296.0)
    }

    /// Returns a random duration between `low` and `high` seconds as a number of samples at `rate`
    /// Hz, at least 1.
    pub(super) fn samples(&mut self, low: f64, high: f64, rate: f64) -> u32 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 20 s at 16 kHz"
        )]
        let samples = (self.uniform(low, high) * rate) as u32;
        samples.max(1)
    }

    /// Returns a uniformly distributed index below `count`, which must be above 0.
    pub(super) fn index(&mut self, count: usize) -> usize {
        let scaled = (u128::from(self.random.next_u64()) * count as u128) >> 64;
        usize::try_from(scaled).unwrap_or(0)
    }
}

/// First-order low-pass noise of variance 1: `x <- pole * x + drive * normal`.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPassNoise {
    pole: f64,
    drive: f64,
    value: f64,
}

impl LowPassNoise {
    /// Creates the noise with a random first value; corner frequency and sample rate are in Hz.
    pub(crate) fn new(corner: f64, rate: f64, noise: &mut Noise) -> Self {
        let pole = pole(corner, rate);
        Self { pole, drive: (1.0 - pole * pole).sqrt(), value: noise.normal() }
    }

    pub(super) fn advance(&mut self, noise: &mut Noise) -> f64 {
        self.value = self.pole * self.value + self.drive * noise.normal();
        self.value
    }
}

/// Second-order low-pass noise of variance 1: a [`LowPassNoise`] through a low-pass of the same
/// corner frequency, `y <- pole * y + drive * x`. Its spectrum falls as 1/f^4, whereas the spectrum
/// of [`LowPassNoise`] falls as 1/f^2.
#[derive(Debug, Clone, Copy)]
pub(super) struct SmoothNoise {
    input: LowPassNoise,
    drive: f64,
    value: f64,
}

impl SmoothNoise {
    /// Creates the noise with a random first value; corner frequency and sample rate are in Hz.
    pub(crate) fn new(corner: f64, rate: f64, noise: &mut Noise) -> Self {
        let square = pole(corner, rate) * pole(corner, rate);
        Self {
            input: LowPassNoise::new(corner, rate, noise),
            // The variance of `y` is drive^2 (1 + pole^2) / (1 - pole^2)^2; this `drive` makes it
            // 1.
            drive: (1.0 - square) / (1.0 + square).sqrt(),
            value: noise.normal(),
        }
    }

    pub(super) fn advance(&mut self, noise: &mut Noise) -> f64 {
        self.value = self.input.pole * self.value + self.drive * self.input.advance(noise);
        self.value
    }
}

/// Returns the pole of a first-order low-pass by the bilinear transform,
/// `(1 - pi f / rate) / (1 + pi f / rate)`. This is a rational function, so the result is equal on
/// every platform.
pub(super) fn pole(corner: f64, rate: f64) -> f64 {
    let angle = std::f64::consts::PI * corner / rate;
    (1.0 - angle) / (1.0 + angle)
}
