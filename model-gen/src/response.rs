//! Response of a cascade, computed in f64 from its quantised coefficients.

use std::f64::consts::PI;

use fixed_dsp::Section;
use num_complex::Complex64;

use crate::{
    cascade::{denominator, numerator},
    error::FilterError,
};

/// Returns the complex gain of the cascade at `frequency_hz`.
pub fn frequency_response(sections: &[Section], frequency_hz: f64, rate_hz: f64) -> Complex64 {
    let z = Complex64::from_polar(1.0, -2.0 * PI * frequency_hz / rate_hz);
    sections
        .iter()
        .map(|section| {
            let [b0, b1, b2] = numerator(section);
            let (d1, d2) = denominator(section);
            (b0 + z * (b1 + z * b2)) / (1.0 + z * (d1 + z * d2))
        })
        .product()
}

/// Returns the group delay at `frequency_hz` in seconds: -d(phase)/d(angular frequency), as a
/// central difference over 0.02 Hz. `response` returns the complex gain at a frequency in Hz.
pub fn group_delay_s(response: impl Fn(f64) -> Complex64, frequency_hz: f64) -> f64 {
    const STEP_HZ: f64 = 0.01;
    let phase = (response(frequency_hz + STEP_HZ) / response(frequency_hz - STEP_HZ)).arg();
    -phase / (2.0 * PI * 2.0 * STEP_HZ)
}

/// Filters `input` with the quantised coefficients of a cascade; all arithmetic is in f64.
pub fn filter(sections: &[Section], input: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let mut states = vec![[0.0_f64; 4]; sections.len()];
    input.map(move |x| {
        let mut signal = x;
        for (section, state) in sections.iter().zip(&mut states) {
            let ([b0, b1, b2], (d1, d2)) = (numerator(section), denominator(section));
            let [x1, x2, y1, y2] = *state;
            let y = b0 * signal + b1 * x1 + b2 * x2 - d1 * y1 - d2 * y2;
            *state = [signal, x1, y, y1];
            signal = y;
        }
        signal
    })
}

/// Longest impulse response that is computed, samples: 32 MiB as f64, or 68 minutes at 1024 Hz.
pub(crate) const MAX_SAMPLES: f64 = 4_194_304.0;

/// Returns the number of samples after which the impulse response has decayed: 4/3 of the n for
/// which `r^n` is 1e-15, where r is the largest distance of a pole from the origin. The factor 4/3
/// allows for several poles, which together decay more slowly than one.
///
/// # Errors
/// If the number is above 2^22.
pub fn decay_samples(sections: &[Section]) -> Result<usize, FilterError> {
    let slowest = sections.iter().map(pole_radius).fold(0.0, f64::max);
    let samples = (4.0 / 3.0 * 1e-15_f64.ln() / slowest.ln()).ceil().max(16.0);
    if samples > MAX_SAMPLES || samples.is_nan() {
        return Err(FilterError::SlowDecay(slowest, samples));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "16..=2^22")]
    Ok(samples as usize)
}

/// Returns the distance from the origin to the farther of the section's two poles.
fn pole_radius(section: &Section) -> f64 {
    let (d1, d2) = denominator(section);
    let root = Complex64::new(d1 * d1 / 4.0 - d2, 0.0).sqrt();
    (-d1 / 2.0 + root).norm().max((-d1 / 2.0 - root).norm())
}
