//! Float64 twin of the filters: with the specified, unquantised coefficients, and in direct form I.

use artifact::Filters;
use model_gen::design::{butterworth_band_pass, notch};
use num_complex::Complex64;

/// Mains frequency that the filters stop, Hz.
pub const MAINS_HZ: f64 = 50.0;

/// Band-pass and notches in float64, with their states.
#[derive(Debug, Clone)]
pub struct Twin {
    /// Coefficients `b0, b1, b2, a1, a2` of each section.
    sections: Vec<[f64; 5]>,
    /// Previous inputs and outputs `x1, x2, y1, y2` of each section.
    states: Vec<[f64; 4]>,
}

impl Twin {
    /// Designs the filters for 50 Hz mains at the model's ADC rate, with all states zero.
    pub fn new(filters: &Filters) -> Self {
        let rate_hz = model::ADC_RATE_HZ.into();
        let notches = (1..=filters.harmonics + 1).map(|multiple| {
            let notch = notch(MAINS_HZ * f64::from(multiple), filters.notch_q, rate_hz);
            let cosine = notch.gain * notch.cosine;
            [
                notch.gain,
                cosine,
                notch.gain,
                cosine,
                2.0 * notch.gain - 1.0,
            ]
        });
        let [low, high] = filters.band_hz;
        let order = usize::try_from(filters.order).unwrap_or(usize::MAX);
        let band_pass = butterworth_band_pass(order, low, high, rate_hz);
        let (real, complex): (Vec<Complex64>, Vec<Complex64>) = band_pass
            .poles
            .iter()
            .partition(|pole| pole.im.abs() < 1e-9);
        let above = complex.into_iter().filter(|pole| pole.im > 0.0);
        let pairs = above.map(|pole| [pole, pole.conj()]);
        // Each pair of poles gets one zero at DC and one at the Nyquist frequency.
        let pairs = pairs.chain(real.as_chunks().0.iter().copied());
        let pairs = pairs.map(|[p, q]| [1.0, 0.0, -1.0, -(p + q).re, (p * q).re]);
        let mut sections: Vec<[f64; 5]> = pairs.chain(notches).collect();
        for b in &mut sections[0][..3] {
            *b *= band_pass.gain;
        }
        Self {
            states: vec![[0.0; 4]; sections.len()],
            sections,
        }
    }

    /// Filters one sample.
    pub fn apply(&mut self, x: f64) -> f64 {
        let sections = self.sections.iter().zip(&mut self.states);
        sections.fold(x, |x, ([b0, b1, b2, a1, a2], state)| {
            let [x1, x2, y1, y2] = *state;
            let y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2;
            *state = [x, x1, y, y1];
            y
        })
    }
}
