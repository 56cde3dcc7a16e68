//! The whole filter chain from the ADC to the encoder's time steps: a cascade, then a resampler.

use fixed_dsp::Section;
use num_complex::Complex64;

use crate::{error::FilterError, resampler::ResamplerTable, response};

/// A quantised cascade followed by a quantised resampler, at one ADC rate.
#[derive(Clone, Copy, Debug)]
pub struct Chain<'a> {
    /// Sections of the cascade, in signal order.
    pub sections: &'a [Section],
    /// Resampler that reads the output of the cascade.
    pub resampler: &'a ResamplerTable,
    /// Sampling rate of the ADC, for which cascade and resampler are designed, Hz.
    pub rate_hz: u32,
}

impl Chain<'_> {
    /// Returns the complex gain for an input tone at `frequency_hz`. A tone above half of the step
    /// rate appears in the output at its alias frequency, with this gain.
    pub fn frequency_response(&self, frequency_hz: f64) -> Complex64 {
        let rate_hz = f64::from(self.rate_hz);
        response::frequency_response(self.sections, frequency_hz, rate_hz)
            * self.resampler.frequency_response(frequency_hz, rate_hz)
    }

    /// Returns the group delay at `frequency_hz` from the ADC's input to the output, seconds.
    pub fn group_delay_s(&self, frequency_hz: f64) -> f64 {
        response::group_delay_s(|hz| self.frequency_response(hz), frequency_hz)
    }

    /// Returns the largest output for inputs of magnitude 1: the L1 norm of the impulse response
    /// from the ADC's samples to the outputs, at the resampler phase where this norm is largest.
    ///
    /// # Errors
    /// If the cascade's response decays too slowly ([`response::decay_samples`]).
    pub fn worst_gain(&self) -> Result<f64, FilterError> {
        let impulse = self.cascade_response(std::iter::once(1.0).chain(std::iter::repeat(0.0)))?;
        let norm = |phase: Vec<f64>| -> f64 {
            (0..impulse.len() + phase.len()).map(|n| phase_output(&phase, &impulse, n).abs()).sum()
        };
        Ok(self.resampler.phase_responses().map(norm).fold(0.0, f64::max))
    }

    /// Returns how long the output of every phase of the resampler takes to fall below `threshold`
    /// for good after a unit step at the input, in ADC samples.
    ///
    /// # Errors
    /// If the cascade's response decays too slowly ([`response::decay_samples`]).
    pub fn settling_samples(&self, threshold: f64) -> Result<usize, FilterError> {
        let step = self.cascade_response(std::iter::repeat(1.0))?;
        let phases: Vec<Vec<f64>> = self.resampler.phase_responses().collect();
        let unsettled = |n: &usize| {
            phases.iter().any(|phase| phase_output(phase, &step, *n).abs() >= threshold)
        };
        // The magnitudes of a phase's taps sum to less than 2. So the output is below the threshold
        // when all samples in the delay line are below half the threshold.
        let quiet = step
            .iter()
            .rposition(|y| y.abs() >= threshold / 2.0)
            .map_or(0, |last| last + self.resampler.taps_per_phase());
        Ok((0..=quiet).rfind(unsettled).map_or(0, |last| last + 1))
    }

    /// Returns the start of the cascade's output for `input`: as many samples as the cascade's
    /// impulse response takes to decay.
    fn cascade_response(&self, input: impl Iterator<Item = f64>) -> Result<Vec<f64>, FilterError> {
        let samples = response::decay_samples(self.sections)?;
        Ok(response::filter(self.sections, input.take(samples)).collect())
    }
}

/// Returns the output of one phase of the resampler when sample `n` of `signal` is the newest.
/// `signal` is taken as 0 before its start and after its end.
fn phase_output(phase: &[f64], signal: &[f64], n: usize) -> f64 {
    let first = (n + 1).saturating_sub(signal.len());
    phase.iter().enumerate().take(n + 1).skip(first).map(|(age, tap)| tap * signal[n - age]).sum()
}
