//! What a quantised cascade does, computed in f64 from its integers.

use std::f64::consts::PI;

use fixed_dsp::Section;
use num_complex::Complex64;

use crate::{
    FilterError,
    cascade::{denominator, numerator},
};

/// Complex gain of the cascade at `frequency_hz`.
pub fn frequency_response(sections: &[Section], frequency_hz: f64, rate_hz: f64) -> Complex64 {
    let z = Complex64::from_polar(1.0, -2.0 * PI * frequency_hz / rate_hz);
    sections
        .iter()
        .map(|section| {
            let [b0, b1, b2] = numerator(section);
            let (a1, a2) = denominator(section);
            (b0 + z * (b1 + z * b2)) / (1.0 + z * (a1 + z * a2))
        })
        .product()
}

/// Group delay in seconds at `frequency_hz` of anything that has a complex gain at each frequency:
/// -d(phase)/d(angular frequency), as a central difference over 0.02 Hz.
pub fn group_delay_s(response: impl Fn(f64) -> Complex64, frequency_hz: f64) -> f64 {
    const STEP_HZ: f64 = 0.01;
    let turn = (response(frequency_hz + STEP_HZ) / response(frequency_hz - STEP_HZ)).arg();
    -turn / (2.0 * PI * 2.0 * STEP_HZ)
}

/// Response of a cascade to `input`, unquantised signal, quantised coefficients.
pub fn filter(sections: &[Section], input: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let mut states = vec![[0.0_f64; 4]; sections.len()];
    input.map(move |x| {
        let mut signal = x;
        for (section, state) in sections.iter().zip(&mut states) {
            let ([b0, b1, b2], (a1, a2)) = (numerator(section), denominator(section));
            let [x1, x2, y1, y2] = *state;
            let y = b0 * signal + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2;
            *state = [signal, x1, y, y1];
            signal = y;
        }
        signal
    })
}

/// The longest impulse response that is followed: 64 MB of numbers, 68 minutes at 1024 Hz.
const LONGEST: f64 = 4_194_304.0;

/// Samples after which an impulse response has decayed for good: the slowest pole's `r^n` below
/// 1e-15, and a third more for the poles that multiply with it.
///
/// # Errors
/// When that is more than 2^22 samples.
pub fn decay_samples(sections: &[Section]) -> Result<usize, FilterError> {
    let slowest = sections.iter().map(pole_radius).fold(0.0, f64::max);
    let samples = (4.0 / 3.0 * 1e-15_f64.ln() / slowest.ln()).ceil().max(16.0);
    if samples > LONGEST || samples.is_nan() {
        return Err(FilterError::SlowDecay {
            radius: slowest,
            samples,
            longest: LONGEST,
        });
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "16..=2^22"
    )]
    Ok(samples as usize)
}

/// Distance of a section's outer pole from the origin.
fn pole_radius(section: &Section) -> f64 {
    let (a1, a2) = denominator(section);
    let root = Complex64::new(a1 * a1 / 4.0 - a2, 0.0).sqrt();
    (-a1 / 2.0 + root).norm().max((-a1 / 2.0 - root).norm())
}

/// Samples after which the response to a unit step stays below `threshold`.
///
/// # Errors
/// As [`decay_samples`].
pub fn settling_samples(sections: &[Section], threshold: f64) -> Result<usize, FilterError> {
    let step = std::iter::repeat_n(1.0, decay_samples(sections)?);
    Ok(filter(sections, step)
        .enumerate()
        .filter(|(_, y)| y.abs() >= threshold)
        .last()
        .map_or(0, |(index, _)| index + 1))
}
