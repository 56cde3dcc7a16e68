//! The filters as specified, in float64: not quantised, and of another structure.

use model_gen::design::{butterworth_band_pass, notch};
use num_complex::Complex64;

use crate::command::root;
use crate::failure::Failure;

/// A cascade in float64 at rest.
#[derive(Debug, Clone)]
pub(crate) struct Twin {
    /// `b0, b1, b2, a1, a2` of each section.
    sections: Vec<[f64; 5]>,
    /// `x1, x2, y1, y2` of each section.
    states: Vec<[f64; 4]>,
}

impl Twin {
    /// The model's filters for 50 Hz mains, from their specification in the artifact.
    ///
    /// # Errors
    /// The artifact cannot be read.
    pub(crate) fn of_the_model() -> Result<Self, Failure> {
        let artifact = artifact::Artifact::read(&root().join("model/artifact"));
        let artifact = artifact.map_err(|error| Failure::Check {
            what: "reading the model's artifact".to_owned(),
            why: error.to_string(),
            next: "`git status model/artifact`".to_owned(),
        })?;
        Ok(Self::new(
            &artifact.description.filters,
            model::ADC_RATE_HZ.into(),
        ))
    }

    fn new(filters: &artifact::Filters, rate_hz: f64) -> Self {
        let notches = (1..=filters.harmonics + 1).map(|multiple| {
            let notch = notch(50.0 * f64::from(multiple), filters.notch_q, rate_hz);
            let turn = notch.gain * notch.cosine;
            [notch.gain, turn, notch.gain, turn, 2.0 * notch.gain - 1.0]
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
        // Each pair of poles with one zero at DC and one at the Nyquist frequency.
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
    pub(crate) fn step(&mut self, x: f64) -> f64 {
        let sections = self.sections.iter().zip(&mut self.states);
        sections.fold(x, |x, ([b0, b1, b2, a1, a2], state)| {
            let [x1, x2, y1, y2] = *state;
            let y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2;
            *state = [x, x1, y, y1];
            y
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::impulse::ImpulseResponse;

    /// `scipy.signal.freqz` of `butter(5, [0.5, 60], 'bandpass', fs=512)` times `iirnotch(50, 30, 512)`.
    #[test]
    fn the_twin_is_scipys() {
        let twin = ImpulseResponse::of_the_twin(&Twin::of_the_model().expect("the artifact"));
        let scipy = [
            (0.3, -22.432_107_5),
            (30.0, -0.006_695_2),
            (49.0, -2.703_321_9),
            (100.0, -26.399_503_5),
        ];
        for (hz, expected) in scipy {
            let db = twin.magnitude_db(hz);
            // The impulse response ends after 10 s; measured 4e-4 dB at most.
            assert!((db - expected).abs() < 1e-3, "{hz} Hz: {db}");
        }
    }
}
