//! What a quantised cascade does, computed in f64 from its integers.

use std::f64::consts::PI;

use fixed_dsp::Section;
use num_complex::Complex64;

use crate::cascade::{denominator, numerator};

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

/// Group delay in seconds at `frequency_hz`: -d(phase)/d(angular frequency), as a central
/// difference over 0.02 Hz.
pub fn group_delay_s(sections: &[Section], frequency_hz: f64, rate_hz: f64) -> f64 {
    const STEP_HZ: f64 = 0.01;
    let at = |hz| frequency_response(sections, hz, rate_hz);
    let turn = (at(frequency_hz + STEP_HZ) / at(frequency_hz - STEP_HZ)).arg();
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

/// Worst-case gain of the cascade: the L1 norm of its impulse response over `samples` samples.
/// No input of magnitude 1 makes the output larger.
pub fn worst_case_gain(sections: &[Section], samples: usize) -> f64 {
    let impulse = std::iter::once(1.0)
        .chain(std::iter::repeat(0.0))
        .take(samples);
    filter(sections, impulse).map(f64::abs).sum()
}

/// Samples after which the response to a unit step stays below `threshold`; at most `limit`.
pub fn settling_samples(sections: &[Section], threshold: f64, limit: usize) -> usize {
    let step = std::iter::repeat_n(1.0, limit);
    filter(sections, step)
        .enumerate()
        .filter(|(_, y)| y.abs() >= threshold)
        .last()
        .map_or(0, |(index, _)| index + 1)
}
