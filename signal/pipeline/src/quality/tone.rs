//! Amplitude of one frequency within one second: a DFT bin with a Hann window.

use core::f64::consts::TAU;

use micromath::F32Ext;

/// Generates the weights of one DFT bin, sample by sample, for all channels. At k Hz, sample n of
/// the N samples in a second has the weights `1 - cos(2 pi n / N)` times the cosine and the sine of
/// `2 pi k n / N`.
///
/// A second contains a whole number of periods, so the bin rejects an electrode's offset: 20 mV
/// reads as 1 nV, the rounding error of f32. The Hann window rejects drift: at 50 Hz, a ramp of 1
/// mV/s reads as 1.8 nV RMS; without the window it would read as 4.6 uV. Mains that deviates by 0.1
/// Hz reads 0.6 % low.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bin {
    carrier: Rotor,
    window: Rotor,
}

impl Bin {
    /// Creates the bin of `hz` Hz at a rate of `rate_hz` Hz.
    ///
    /// # Panics
    /// If `hz` is not below the Nyquist frequency; at compile time in a `const` context.
    pub(super) const fn new(hz: u8, rate_hz: u16) -> Self {
        assert!(2 * (hz as u16) < rate_hz, "the frequency must be below half of the rate");
        Self { carrier: Rotor::new(hz, rate_hz), window: Rotor::new(1, rate_hz) }
    }

    /// Resets to the first sample of a second.
    pub(super) fn restart(&mut self) {
        self.carrier.at = Rotor::START;
        self.window.at = Rotor::START;
    }

    /// Returns the weights of the next sample: cosine and sine.
    #[inline]
    pub(super) fn next_weights(&mut self) -> [f32; 2] {
        let [cos, sin] = self.carrier.next();
        let hann = 1.0 - self.window.next()[0];
        [hann * cos, hann * sin]
    }
}

/// A phase that advances by the same angle with every sample. Resetting the phase each second
/// bounds its rounding error: at most 3e-5 after 1024 samples (tested).
#[derive(Clone, Copy, Debug)]
struct Rotor {
    /// Cosine and sine of the current phase.
    at: [f32; 2],
    /// Cosine and sine of the angle by which the phase advances with every sample.
    rotation: [f32; 2],
}

impl Rotor {
    const START: [f32; 2] = [1.0, 0.0];

    const fn new(cycles: u8, rate_hz: u16) -> Self {
        Self { at: Self::START, rotation: cos_sin(TAU * cycles as f64 / rate_hz as f64) }
    }

    #[inline]
    fn next(&mut self) -> [f32; 2] {
        let ([cos, sin], [c, s]) = (self.at, self.rotation);
        self.at = [cos * c - sin * s, sin * c + cos * s];
        [cos, sin]
    }
}

/// Returns cosine and sine of an angle in [0, pi]: their power series in f64, rounded to f32.
///
/// micromath's functions are too inaccurate: an error of 1e-3 per sample would add up to half a
/// radian after 512 samples.
#[expect(clippy::cast_possible_truncation, reason = "intentionally rounded to f32")]
const fn cos_sin(angle: f64) -> [f32; 2] {
    let (mut cos, mut sin) = (0.0, 0.0);
    let mut term = 1.0;
    let mut order = 0.0;
    // The first omitted term is at most pi^32 / 32! = 3e-20.
    while order < 32.0 {
        cos += term;
        term *= angle / (order + 1.0);
        sin += term;
        term *= -angle / (order + 2.0);
        order += 2.0;
    }
    [cos as f32, sin as f32]
}

/// Weighted sums of one channel: real and imaginary part of a DFT bin.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tone([f32; 2]);

impl Tone {
    pub(super) const ZERO: Self = Self([0.0; 2]);

    /// Adds a sample, multiplied by the bin's weights for this sample.
    #[inline]
    pub(super) fn add(&mut self, x: f32, weights: [f32; 2]) {
        self.0[0] += weights[0] * x;
        self.0[1] += weights[1] * x;
    }

    /// Returns the RMS at the bin's frequency, in the unit of the samples; all `rate_hz` samples of
    /// a second must have been added.
    pub(super) fn rms(self, rate_hz: u16) -> f32 {
        let [re, im] = self.0;
        // The amplitude is 2 |X| / N, because the mean of the Hann window is 1. The RMS of a sine
        // is its amplitude over sqrt(2).
        core::f32::consts::SQRT_2 * square_root(re * re + im * im) / f32::from(rate_hz)
    }
}

/// Returns the square root with a relative error of 2e-6: micromath's, which is up to 6 % too
/// large, refined by two iterations of Heron's method.
pub(super) fn square_root(x: f32) -> f32 {
    // Called by path, because in tests, which link std, `x.sqrt()` would call std's function.
    let guess = F32Ext::sqrt(x);
    let better = 0.5 * (guess + x / guess);
    0.5 * (better + x / better)
}

#[cfg(test)]
mod tests {
    use std::{f64, vec::Vec};

    use super::*;

    /// ADC rates at which the DFT bins are tested, Hz.
    const RATES: [u16; 6] = [250, 256, 500, 512, 1000, 1024];

    fn rms_of(hz: u8, rate_hz: u16, x: impl Fn(f64) -> f64) -> f64 {
        let mut bin = Bin::new(hz, rate_hz);
        let mut tone = Tone::default();
        for n in 0..rate_hz {
            #[expect(clippy::cast_possible_truncation, reason = "rounds to f32")]
            let x = x(f64::from(n) / f64::from(rate_hz)) as f32;
            tone.add(x, bin.next_weights());
        }
        tone.rms(rate_hz).into()
    }

    #[test]
    fn a_sine_of_the_frequency_reads_its_rms_at_every_phase_and_rate() {
        for (rate, hz) in RATES.iter().flat_map(|&rate| [(rate, 50), (rate, 60)]) {
            for phase in [0.0, 0.7, 2.0] {
                let read = rms_of(hz, rate, |t| {
                    3.0 * (f64::consts::TAU * f64::from(hz) * t + phase).sin()
                });
                // The phase is rounded to f32 at every sample. Largest measured error: 1.2e-5.
                let relative = read / (3.0 / f64::consts::SQRT_2) - 1.0;
                assert!(relative.abs() < 3e-5, "{relative} at {rate} Hz");
            }
        }
    }

    #[test]
    fn offsets_ramps_and_other_frequencies_are_rejected() {
        for (rate, hz) in RATES.iter().flat_map(|&rate| [(rate, 50), (rate, 60)]) {
            let near = |t: f64| (f64::consts::TAU * (f64::from(hz) - 2.0) * t).sin();
            // Largest measured readings: offset 4.7e-8; ramp 1.8e-6, which is the leakage of the
            // window and the same when computed in f64; sine 2 Hz below the bin 1.3e-6.
            for (name, read, limit) in [
                ("offset", rms_of(hz, rate, |_| 1.0), 1e-7),
                ("ramp", rms_of(hz, rate, |t| t), 2e-6),
                ("2 Hz lower", rms_of(hz, rate, near), 3e-6),
            ] {
                assert!(read < limit, "{name}: {read} at {rate} Hz");
            }
        }
    }

    #[test]
    fn the_phase_is_accurate_at_the_end_of_a_second() {
        for (rate, cycles) in RATES.iter().flat_map(|&rate| [(rate, 1), (rate, 60)]) {
            let mut rotor = Rotor::new(cycles, rate);
            let worst = (0..rate)
                .map(|n| {
                    let angle = TAU * f64::from(cycles) * f64::from(n) / f64::from(rate);
                    let [cos, sin] = rotor.next().map(f64::from);
                    (cos - angle.cos()).hypot(sin - angle.sin())
                })
                .fold(0.0, f64::max);
            assert!(worst < 3e-5, "{worst} after {rate} samples");
        }
    }

    #[test]
    fn the_square_root_is_accurate_to_2e_6_over_the_whole_range() {
        let inputs: Vec<f32> = (-80..80)
            .flat_map(|power| [1.0, 1.37, 1.99, 3.0].map(|m: f32| m * 2.0_f32.powi(power)))
            .collect();
        for x in inputs {
            let relative = f64::from(square_root(x)) / f64::from(x).sqrt() - 1.0;
            assert!(relative.abs() < 2e-6, "{relative} at {x}");
        }
        assert!(square_root(0.0) < 1e-19);
    }
}
