//! Resamples signals of one rate to the rate of the ADC, with a band limit.

use crate::{error::RecordingError, ratio::Ratio};

use super::low_pass::{LowPass, weighted_sum};

/// Largest number of input samples from one output to the next, which bounds the number of taps.
const STEP_MAX: f64 = 1000.0;

/// Smallest number of used input samples that are removed from the queue at once, so large that
/// moving the remaining samples costs little per sample.
const USED_MAX: usize = 4096;

/// Converts several signals to another rate without a time shift: output k is exactly the input at
/// the time k / output rate, however long the signals are. An output is available when the input
/// has been appended up to half the filter's length after the output's time.
///
/// Beyond its ends, a signal keeps its first or last value, so that an electrode's offset causes no
/// ringing.
pub(super) struct RateConverter {
    /// `None` if input rate and output rate are equal.
    resampler: Option<Resampler>,
    /// Samples of each signal, uV. Before its start, a resampled signal repeats its first value.
    input: Vec<Vec<f64>>,
    /// Index in `input` of the first sample that the next output depends on.
    at: usize,
    /// Newest outputs of each signal, uV, if they are resampled.
    output: Vec<Vec<f64>>,
}

/// The resampling filter and the position of the next output.
struct Resampler {
    low_pass: LowPass,
    /// Number of input samples from one output to the next.
    step: Ratio,
    /// Fractional part of the next output's position, in units of 1 / (denominator of `step`) of an
    /// input sample.
    phase: u64,
}

impl RateConverter {
    /// Creates a converter from `rate` to `rate_hz` for `signals` signals. In errors, `label` names
    /// one of these signals.
    ///
    /// # Errors
    /// [`RecordingError::Rate`] if `rate` is more than [`STEP_MAX`] times `rate_hz`, or if their
    /// ratio has terms of more than 64 bits.
    pub(super) fn new(
        label: &str,
        rate: Ratio,
        rate_hz: u32,
        signals: usize,
    ) -> Result<Self, RecordingError> {
        let denominator = rate.denominator().checked_mul(rate_hz.into());
        let step = denominator.and_then(|denominator| Ratio::new(rate.numerator(), denominator));
        let step = step.filter(|step| step.value() <= STEP_MAX);
        let step = step.ok_or_else(|| RecordingError::Rate {
            label: label.to_owned(),
            rate: rate.to_string(),
            rate_hz,
        })?;
        let is_resampled = step.numerator() != step.denominator();
        Ok(Self {
            resampler: is_resampled.then(|| Resampler {
                low_pass: LowPass::new(rate.value(), step),
                step,
                phase: 0,
            }),
            input: vec![Vec::new(); signals],
            at: 0,
            output: vec![Vec::new(); signals],
        })
    }

    /// Appends samples of a signal, uV.
    pub(super) fn append(&mut self, signal: usize, mut samples: impl Iterator<Item = f64>) {
        let before = self.delay().saturating_sub(1);
        let queue = &mut self.input[signal];
        // After the first samples, the queue of a resampled signal is never empty: from one output
        // to the next, the filter moves by less than its length.
        if queue.is_empty()
            && let Some(first) = samples.next()
        {
            queue.extend(std::iter::repeat_n(first, before + 1));
        }
        queue.extend(samples);
    }

    /// Returns the largest number of input samples from the time of an output to the last input
    /// sample that the output depends on; 0 if nothing is resampled.
    pub(super) fn delay(&self) -> usize {
        let resampler = self.resampler.as_ref();
        resampler.map_or(0, |resampler| resampler.low_pass.taps() / 2)
    }

    /// Returns the number of outputs that the samples appended so far allow.
    pub(super) fn ready(&self) -> usize {
        let samples = self.input.iter().map(Vec::len).min().unwrap_or(0) - self.at;
        match &self.resampler {
            Some(resampler) => resampler.ready(samples),
            None => samples,
        }
    }

    /// Computes the next `outputs` outputs of all signals, at most [`Self::ready`].
    pub(super) fn convert(&mut self, outputs: usize) {
        if self.at >= USED_MAX {
            for queue in &mut self.input {
                queue.drain(..self.at);
            }
            self.at = 0;
        }
        let Some(resampler) = &mut self.resampler else {
            self.at += outputs;
            return;
        };
        self.output.iter_mut().for_each(Vec::clear);
        for _ in 0..outputs {
            let taps = resampler.low_pass.phase(resampler.phase);
            let window = self.at..self.at + taps.len();
            for (input, output) in self.input.iter().zip(&mut self.output) {
                output.push(weighted_sum(taps, &input[window.clone()]));
            }
            self.at += resampler.advance();
        }
    }

    /// Returns the `outputs` outputs of a signal that [`Self::convert`] has computed, uV.
    pub(super) fn outputs(&self, signal: usize, outputs: usize) -> &[f64] {
        match self.resampler {
            Some(_) => &self.output[signal],
            None => &self.input[signal][self.at - outputs..self.at],
        }
    }

    /// Returns the largest number of samples in memory for one signal, including used samples.
    #[cfg(test)]
    pub(super) fn queued_samples(&self) -> usize {
        self.input.iter().map(Vec::len).max().unwrap_or(0)
    }
}

impl Resampler {
    /// Returns the number of outputs that can be computed from `samples` input samples, counted
    /// from the first sample that the next output depends on.
    fn ready(&self, samples: usize) -> usize {
        let Some(spare) = samples.checked_sub(self.low_pass.taps()) else {
            return 0;
        };
        // Output j, counted from 0, starts at sample floor((phase + j numerator) / denominator),
        // which must be at most `spare`.
        let [numerator, denominator] =
            [self.step.numerator(), self.step.denominator()].map(u128::from);
        let room = (spare as u128 + 1) * denominator - u128::from(self.phase);
        usize::try_from(room.div_ceil(numerator)).unwrap_or(usize::MAX)
    }

    /// Moves to the next output. Returns the number of samples by which the filter moves.
    fn advance(&mut self) -> usize {
        let [numerator, denominator] = [self.step.numerator(), self.step.denominator()];
        let (whole, fraction) = (numerator / denominator, numerator % denominator);
        let is_carried = self.phase >= denominator - fraction;
        self.phase =
            if is_carried { self.phase - (denominator - fraction) } else { self.phase + fraction };
        usize::try_from(whole).unwrap_or(usize::MAX) + usize::from(is_carried)
    }
}
