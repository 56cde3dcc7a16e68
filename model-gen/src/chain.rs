//! Everything between the ADC and a step as one: the cascade, then the resampler.

use fixed_dsp::Section;
use num_complex::Complex64;

use crate::{FilterError, ResamplerTable, response};

/// A cascade and the resampler behind it, as quantised, at one rate of the ADC.
#[derive(Clone, Copy, Debug)]
pub struct Chain<'a> {
    /// The cascade.
    pub sections: &'a [Section],
    /// What follows it.
    pub resampler: &'a ResamplerTable,
    /// The ADC's rate, Hz.
    pub rate_hz: u32,
}

impl Chain<'_> {
    /// Complex gain at `frequency_hz`, which may lie above half of the steps' rate: a tone there
    /// comes out with this gain at the frequency onto which it folds.
    pub fn frequency_response(&self, frequency_hz: f64) -> Complex64 {
        let rate_hz = f64::from(self.rate_hz);
        response::frequency_response(self.sections, frequency_hz, rate_hz)
            * self.resampler.frequency_response(frequency_hz, rate_hz)
    }

    /// Group delay in seconds at `frequency_hz`, from a sample to the time at which an output
    /// stands.
    pub fn group_delay_s(&self, frequency_hz: f64) -> f64 {
        response::group_delay_s(|hz| self.frequency_response(hz), frequency_hz)
    }

    /// Largest output for an input of magnitude 1: the L1 norm of the impulse response from the
    /// ADC's samples to the outputs of the phase that has the largest.
    ///
    /// # Errors
    /// When the cascade's response does not end ([`response::decay_samples`]).
    pub fn worst_gain(&self) -> Result<f64, FilterError> {
        let impulse = self.cascade_response(std::iter::once(1.0).chain(std::iter::repeat(0.0)))?;
        let norm = |phase: Vec<f64>| -> f64 {
            (0..impulse.len() + phase.len())
                .map(|n| output(&phase, &impulse, n).abs())
                .sum()
        };
        Ok(self
            .resampler
            .phase_responses()
            .map(norm)
            .fold(0.0, f64::max))
    }

    /// Samples after which every output's response to a unit step stays below `threshold`.
    ///
    /// # Errors
    /// When the cascade's response does not end ([`response::decay_samples`]).
    pub fn settling_samples(&self, threshold: f64) -> Result<usize, FilterError> {
        let step = self.cascade_response(std::iter::repeat(1.0))?;
        let phases: Vec<Vec<f64>> = self.resampler.phase_responses().collect();
        let unsettled = |n: &usize| {
            phases
                .iter()
                .any(|phase| output(phase, &step, *n).abs() >= threshold)
        };
        // The taps' magnitudes add up to less than 2, so half the threshold in is below it out.
        let quiet = step
            .iter()
            .rposition(|y| y.abs() >= threshold / 2.0)
            .map_or(0, |last| last + self.resampler.taps_per_phase());
        Ok((0..=quiet).rfind(unsettled).map_or(0, |last| last + 1))
    }

    /// What the cascade makes of `input` until its response has decayed.
    fn cascade_response(&self, input: impl Iterator<Item = f64>) -> Result<Vec<f64>, FilterError> {
        let samples = response::decay_samples(self.sections)?;
        Ok(response::filter(self.sections, input.take(samples)).collect())
    }
}

/// A phase's output with sample `n` of a signal that is 0 before its start and after its end.
fn output(phase: &[f64], signal: &[f64], n: usize) -> f64 {
    let first = (n + 1).saturating_sub(signal.len());
    phase
        .iter()
        .enumerate()
        .take(n + 1)
        .skip(first)
        .map(|(age, tap)| tap * signal[n - age])
        .sum()
}
