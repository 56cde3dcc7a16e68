//! Band-limited conversion of several signals from one rate to the ADC's.

use rubato::{
    Fft, FixedSync, Resampler,
    audioadapter_buffers::direct::{SequentialSliceOfSlices, SequentialSliceOfVecs},
};

use crate::{
    RecordingError,
    ratio::{Ratio, greatest_common_divisor},
};

/// Samples of the slower side in one transform: 1024 put the anti-aliasing filter's edge at
/// 0.986 of the lower Nyquist frequency.
const BLOCK: u64 = 1024;
/// No side of a transform gets longer than this; pairs of rates that would need it are refused.
const BLOCK_MAX: u64 = 1 << 17;

/// Outputs that may lie behind the reader before their memory is used again: few beside one
/// block, enough that moving the rest costs little per sample.
const TAKEN_MAX: usize = 4096;

/// Converts the rate of `lines` signals without shifting them in time: output k is the input at
/// k / rate.
///
/// Before its first and behind its last sample a signal is taken to stay where it was, so an
/// electrode's offset does not ring; within half a block (512 input samples) of either end the
/// signal is band-limited together with that guess.
pub(crate) struct RateConverter {
    stage: Option<Stage>,
    /// uV at the input rate, per line.
    input: Vec<Vec<f64>>,
    /// uV at the ADC's rate, per line; `taken` of each have been taken.
    output: Vec<Vec<f64>>,
    taken: usize,
}

/// The resampler and what its delay asks for; absent when the rates are equal.
struct Stage {
    resampler: Fft<f64>,
    converted: Vec<Vec<f64>>,
    block_in: usize,
    block_out: usize,
    /// Outputs still to be left out: the block that primes the filter and the filter's delay.
    skip: usize,
    primed: bool,
}

impl RateConverter {
    /// A converter for `lines` signals.
    ///
    /// # Errors
    /// `Err(reason)` when the two rates need a transform longer than [`BLOCK_MAX`].
    pub(crate) fn new(
        rate: Ratio,
        rate_hz: u32,
        lines: usize,
    ) -> Result<Result<Self, &'static str>, RecordingError> {
        let empty = || vec![Vec::new(); lines];
        let mut converter = Self {
            stage: None,
            input: empty(),
            output: empty(),
            taken: 0,
        };
        let Some(wanted) = u64::from(rate_hz).checked_mul(rate.denominator()) else {
            return Ok(Err("its rate is not a plain fraction"));
        };
        if wanted == rate.numerator() {
            return Ok(Ok(converter));
        }
        let divisor = greatest_common_divisor(wanted, rate.numerator());
        let (unit_in, unit_out) = (rate.numerator() / divisor, wanted / divisor);
        // An even number of units, so that the filter's delay is whole on both sides.
        let most = BLOCK_MAX / unit_in.max(unit_out) / 2 * 2;
        let units = BLOCK
            .div_ceil(unit_in.min(unit_out))
            .next_multiple_of(2)
            .min(most);
        if units == 0 {
            return Ok(Err(
                "the two rates have no common measure of a usable length",
            ));
        }
        let size = |unit: u64| usize::try_from(units * unit).unwrap_or(usize::MAX);
        let (block_in, block_out) = (size(unit_in), size(unit_out));
        let resampler = Fft::new_custom(
            block_in,
            block_out,
            block_in,
            1,
            lines,
            rubato::WindowFunction::BlackmanHarris2,
            FixedSync::Both,
        )?;
        let skip = block_out + resampler.output_delay();
        let converted = vec![vec![0.0; block_out]; lines];
        converter.stage = Some(Stage {
            resampler,
            converted,
            block_in,
            block_out,
            skip,
            primed: false,
        });
        Ok(Ok(converter))
    }

    /// The queue that new samples of a line, uV, are appended to.
    pub(crate) fn line(&mut self, line: usize) -> &mut Vec<f64> {
        if self.stage.is_some() {
            &mut self.input[line]
        } else {
            &mut self.output[line]
        }
    }

    /// Converts what has been appended, as far as it fills blocks.
    ///
    /// # Errors
    /// [`RecordingError::Resampler`].
    pub(crate) fn convert(&mut self) -> Result<(), RecordingError> {
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        if !stage.primed {
            if self.input.iter().any(Vec::is_empty) {
                return Ok(());
            }
            for line in &mut self.input {
                let held = std::iter::repeat_n(line[0], stage.block_in);
                line.splice(0..0, held);
            }
            stage.primed = true;
        }
        let waiting = self.input.iter().map(Vec::len).min().unwrap_or(0);
        let mut at = 0;
        while at + stage.block_in <= waiting {
            stage.convert(&self.input, at, &mut self.output)?;
            at += stage.block_in;
        }
        for line in &mut self.input {
            line.drain(..at);
        }
        Ok(())
    }

    /// Pushes the converter's last outputs out by one more block of unchanging input.
    ///
    /// # Errors
    /// [`RecordingError::Resampler`].
    pub(crate) fn flush(&mut self, held: &[f64]) -> Result<(), RecordingError> {
        let block = self.stage.as_ref().map_or(1, |stage| stage.block_in);
        for (line, &value) in held.iter().enumerate() {
            self.line(line).extend(std::iter::repeat_n(value, block));
        }
        self.convert()
    }

    /// How many outputs can be taken.
    pub(crate) fn ready(&self) -> usize {
        self.output.iter().map(Vec::len).min().unwrap_or(0) - self.taken
    }

    /// The next output of a line, uV; ask [`Self::ready`] first.
    pub(crate) fn peek(&self, line: usize) -> f64 {
        self.output[line].get(self.taken).copied().unwrap_or(0.0)
    }

    /// Samples that are held in memory per line, inputs and outputs, taken ones included.
    #[cfg(test)]
    pub(crate) fn held(&self) -> usize {
        let most = |lines: &[Vec<f64>]| lines.iter().map(Vec::len).max().unwrap_or(0);
        most(&self.input) + most(&self.output)
    }

    /// Goes on to the next output.
    ///
    /// What has been taken is let go by its own number, not when nothing is left: a converter
    /// that shares a recording with one of a longer delay is ahead of it to the end.
    pub(crate) fn advance(&mut self) {
        self.taken += 1;
        if self.taken >= TAKEN_MAX {
            for line in &mut self.output {
                line.drain(..self.taken);
            }
            self.taken = 0;
        }
    }
}

impl Stage {
    fn convert(
        &mut self,
        input: &[Vec<f64>],
        at: usize,
        output: &mut [Vec<f64>],
    ) -> Result<(), RecordingError> {
        let lines = input.len();
        let block: Vec<&[f64]> = input
            .iter()
            .map(|line| &line[at..at + self.block_in])
            .collect();
        let from = SequentialSliceOfSlices::new(&block, lines, self.block_in);
        let to = SequentialSliceOfVecs::new_mut(&mut self.converted, lines, self.block_out);
        let (Ok(from), Ok(mut to)) = (from, to) else {
            return Err(RecordingError::ResamplerBuffer);
        };
        self.resampler.process_into_buffer(&from, &mut to, None)?;
        let skip = self.skip.min(self.block_out);
        self.skip -= skip;
        for (line, converted) in output.iter_mut().zip(&self.converted) {
            line.extend_from_slice(&converted[skip..]);
        }
        Ok(())
    }
}
