//! Converts signals of one rate to the rate of the ADC, with a band limit.

use rubato::{
    Fft, FixedSync, Resampler,
    audioadapter_buffers::direct::{SequentialSliceOfSlices, SequentialSliceOfVecs},
};

use crate::{error::RecordingError, ratio::Ratio};

/// Smallest number of samples in a transform, at the lower of the two rates, unless [`BLOCK_MAX`]
/// requires less. With 1024 samples the edge of the anti-aliasing filter is at 0.987 of the lower
/// Nyquist frequency.
const BLOCK: u64 = 1024;
/// Largest number of samples in a transform, at either rate. Rates that need more are approximated.
const BLOCK_MAX: u64 = 1 << 17;
/// Largest error of an approximated ratio of rates. Clocks of amplifiers have larger ones.
const ERROR_MAX: f64 = 1e-6;

/// Number of consumed outputs after which their memory is reused. It is small compared with a block
/// read from the file, but large enough that moving the remaining outputs costs little per sample.
const CONSUMED_MAX: usize = 4096;

/// Converts several signals to another rate without a time shift: output k is the input at the time
/// k / output rate. A ratio of rates that needs too long a transform is approximated by one within
/// [`ERROR_MAX`].
///
/// Beyond its ends, a signal keeps its first or last value, so that an electrode's offset does not
/// ring. Within half a block (about 512 samples at the lower of the two rates) of either end, the
/// output depends on this assumption.
pub(crate) struct RateConverter {
    resampler: Option<BlockResampler>,
    /// Samples of each signal that are not converted yet, uV.
    input: Vec<Vec<f64>>,
    /// Converted samples of each signal, uV. The first `consumed` of them have been used already.
    output: Vec<Vec<f64>>,
    consumed: usize,
    /// Relative error of the ratio of rates, parts per million; 0 if the ratio is exact.
    pub(crate) error_ppm: f64,
}

/// A resampler that works in blocks, and what is needed to compensate its delay. A converter has
/// none if input rate and output rate are equal.
struct BlockResampler {
    resampler: Fft<f64>,
    converted: Vec<Vec<f64>>,
    block_in: usize,
    block_out: usize,
    /// Number of outputs still to be discarded: the first block and the delay of the filter.
    skip: usize,
    primed: bool,
}

impl RateConverter {
    /// Creates a converter from `rate` to `rate_hz` for `signals` signals. `label` names one of
    /// them in errors.
    ///
    /// # Errors
    /// [`RecordingError::Rate`] if no ratio within [`ERROR_MAX`] of the two rates allows a
    /// transform of at most [`BLOCK_MAX`] samples, [`RecordingError::ResamplerConstruction`] if the
    /// resampler cannot be built.
    pub(crate) fn new(
        label: &str,
        rate: Ratio,
        rate_hz: u32,
        signals: usize,
    ) -> Result<Self, RecordingError> {
        let empty = || vec![Vec::new(); signals];
        let mut converter = Self {
            resampler: None,
            input: empty(),
            output: empty(),
            consumed: 0,
            error_ppm: 0.0,
        };
        let (ratio, is_approximate) =
            short_ratio(rate, rate_hz).ok_or_else(|| RecordingError::Rate {
                label: label.to_owned(),
                rate: rate.to_string(),
                rate_hz,
            })?;
        if is_approximate {
            let exact = rate.value() / f64::from(rate_hz);
            converter.error_ppm = (ratio.value() / exact - 1.0) * 1e6;
        }
        let (unit_in, unit_out) = (ratio.numerator(), ratio.denominator());
        if unit_in == unit_out {
            return Ok(converter);
        }
        // A unit is the shortest input with a whole number of outputs. With an even number of
        // units, the filter's delay is a whole number of samples at both rates.
        let most = BLOCK_MAX / unit_in.max(unit_out) / 2 * 2;
        let units = BLOCK
            .div_ceil(unit_in.min(unit_out))
            .next_multiple_of(2)
            .min(most);
        let size = |unit: u64| usize::try_from(units * unit).unwrap_or(usize::MAX);
        let (block_in, block_out) = (size(unit_in), size(unit_out));
        let resampler = Fft::new_custom(
            block_in,
            block_out,
            block_in,
            1,
            signals,
            rubato::WindowFunction::BlackmanHarris2,
            FixedSync::Both,
        )?;
        let skip = block_out + resampler.output_delay();
        let converted = vec![vec![0.0; block_out]; signals];
        converter.resampler = Some(BlockResampler {
            resampler,
            converted,
            block_in,
            block_out,
            skip,
            primed: false,
        });
        Ok(converter)
    }

    /// Returns the queue to which new samples of a signal, uV, are appended.
    pub(crate) fn queue_mut(&mut self, signal: usize) -> &mut Vec<f64> {
        if self.resampler.is_some() {
            &mut self.input[signal]
        } else {
            &mut self.output[signal]
        }
    }

    /// Converts all complete blocks of the samples appended so far.
    ///
    /// # Errors
    /// [`RecordingError::Resampler`] or [`RecordingError::ResamplerBuffer`], both of which are
    /// defects of this crate.
    pub(crate) fn convert(&mut self) -> Result<(), RecordingError> {
        let Some(resampler) = &mut self.resampler else {
            return Ok(());
        };
        if !resampler.primed {
            if self.input.iter().any(Vec::is_empty) {
                return Ok(());
            }
            for queue in &mut self.input {
                let held = std::iter::repeat_n(queue[0], resampler.block_in);
                queue.splice(0..0, held);
            }
            resampler.primed = true;
        }
        let waiting = self.input.iter().map(Vec::len).min().unwrap_or(0);
        let mut at = 0;
        while at + resampler.block_in <= waiting {
            resampler.convert(&self.input, at, &mut self.output)?;
            at += resampler.block_in;
        }
        for queue in &mut self.input {
            queue.drain(..at);
        }
        Ok(())
    }

    /// Returns the number of input samples in a block of the resampler; 1 if nothing is resampled.
    pub(crate) fn block(&self) -> usize {
        let resampler = self.resampler.as_ref();
        resampler.map_or(1, |resampler| resampler.block_in)
    }

    /// Returns the number of converted samples that are available for all signals.
    pub(crate) fn ready(&self) -> usize {
        self.output.iter().map(Vec::len).min().unwrap_or(0) - self.consumed
    }

    /// Returns the next `samples` outputs of a signal, uV, or fewer if fewer are ready.
    pub(crate) fn next_outputs(&self, signal: usize, samples: usize) -> &[f64] {
        let outputs = self.output[signal].get(self.consumed..).unwrap_or_default();
        outputs.get(..samples).unwrap_or(outputs)
    }

    /// Returns the largest number of samples in memory for one signal: inputs and outputs,
    /// including consumed outputs.
    #[cfg(test)]
    pub(crate) fn queued_samples(&self) -> usize {
        let longest = |queues: &[Vec<f64>]| queues.iter().map(Vec::len).max().unwrap_or(0);
        longest(&self.input) + longest(&self.output)
    }

    /// Marks the next `samples` outputs as consumed, at most [`Self::ready`].
    ///
    /// Memory is released after a fixed number of outputs. Waiting for an empty queue would not do:
    /// if another converter has a longer delay, the queue of this converter is only empty at the
    /// end of the recording.
    pub(crate) fn advance(&mut self, samples: usize) {
        self.consumed += samples;
        if self.consumed >= CONSUMED_MAX {
            for queue in &mut self.output {
                queue.drain(..self.consumed);
            }
            self.consumed = 0;
        }
    }
}

/// Returns the ratio of `rate` to `rate_hz` if a transform of two units is short enough, or else
/// the simplest ratio within [`ERROR_MAX`] of it, with true; `None` if that one needs too long a
/// transform, too.
fn short_ratio(rate: Ratio, rate_hz: u32) -> Option<(Ratio, bool)> {
    let is_short = |ratio: &Ratio| ratio.numerator().max(ratio.denominator()) <= BLOCK_MAX / 2;
    let denominator = rate.denominator().checked_mul(rate_hz.into());
    let exact = denominator.and_then(|denominator| Ratio::new(rate.numerator(), denominator));
    if let Some(exact) = exact.filter(is_short) {
        return Some((exact, false));
    }
    let value = rate.value() / f64::from(rate_hz);
    let near = Ratio::simplest(value * (1.0 - ERROR_MAX), value * (1.0 + ERROR_MAX));
    near.filter(is_short).map(|near| (near, true))
}

impl BlockResampler {
    fn convert(
        &mut self,
        input: &[Vec<f64>],
        at: usize,
        output: &mut [Vec<f64>],
    ) -> Result<(), RecordingError> {
        let signals = input.len();
        let block: Vec<&[f64]> = input
            .iter()
            .map(|queue| &queue[at..at + self.block_in])
            .collect();
        let from = SequentialSliceOfSlices::new(&block, signals, self.block_in);
        let to = SequentialSliceOfVecs::new_mut(&mut self.converted, signals, self.block_out);
        let (Ok(from), Ok(mut to)) = (from, to) else {
            return Err(RecordingError::ResamplerBuffer);
        };
        self.resampler.process_into_buffer(&from, &mut to, None)?;
        let skip = self.skip.min(self.block_out);
        self.skip -= skip;
        for (queue, converted) in output.iter_mut().zip(&self.converted) {
            queue.extend_from_slice(&converted[skip..]);
        }
        Ok(())
    }
}
