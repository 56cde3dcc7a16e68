//! Converts a recording to the samples that an ADC would have delivered.

mod conversion;
mod count_block;
mod dither;
pub mod live_adc;
mod rails;
mod rate_converter;
mod spec;

use crate::{
    error::RecordingError,
    montage_map::MontageMap,
    recording::{Block, Recording},
};
use conversion::{Conversion, SignalRate};
pub use spec::{AdcCounters, AdcSpec, CHANNELS};

/// Iterator over the samples of a virtual ADC that plays a recording. Each sample has [`CHANNELS`]
/// counts, i24 in i32; sample k is the recording at the time k / `rate_hz`.
///
/// The iterator yields `floor(duration * rate_hz)` samples, or ends after its first error. A signal at
/// the rate of the ADC passes unchanged. Signals at other rates are resampled, band-limited and without
/// delay; beyond the ends of the file, a signal keeps its first or last value. Voltages become counts by
/// `round(uV / lsb_uv)`, ties away from zero, saturating to i24; saturation is counted. Where all eight
/// channels of a converter would repeat their last sample, one count is added
/// (`docs/decisions/0017-dither-of-repeated-samples.md`). A signal whose unit is not a voltage is treated
/// as uV, and the recording has a warning about it.
pub struct VirtualAdc {
    recording: Recording,
    conversion: Conversion,
    block: Block,
    ended: bool,
    samples: u64,
    delivered: u64,
}

impl VirtualAdc {
    /// Creates a virtual ADC that starts at the first record of `recording`.
    ///
    /// # Errors
    /// [`RecordingError::AdcSpec`] if the rate or scale is out of range,
    /// [`RecordingError::TooManyElectrodes`] if the montage has more than [`CHANNELS`] electrodes,
    /// [`RecordingError::MapMismatch`] if `map` belongs to another recording, [`RecordingError::Rate`]
    /// if a signal cannot be resampled.
    pub fn new(
        mut recording: Recording,
        map: &MontageMap,
        spec: AdcSpec,
    ) -> Result<Self, RecordingError> {
        let signals = recording.signals().iter();
        let signals: Vec<SignalRate> = signals
            .map(|signal| SignalRate {
                label: &signal.label,
                rate: signal.rate,
            })
            .collect();
        let conversion = Conversion::new(&signals, map, spec)?;
        recording.rewind();
        let samples = sample_count(&recording, spec.rate_hz);
        Ok(Self {
            recording,
            conversion,
            block: Block::default(),
            ended: false,
            samples,
            delivered: 0,
        })
    }

    /// Leaves repeated samples as they are, for counts that are the exact conversion of the recording. A
    /// driver of real converters takes such samples for a frozen chip.
    #[must_use]
    pub fn without_dither(mut self) -> Self {
        self.conversion.disable_dither();
        self
    }

    /// Rate and scale that were passed to [`VirtualAdc::new`].
    pub fn spec(&self) -> AdcSpec {
        self.conversion.spec()
    }

    /// Returns the recording being played. Its read position is ahead of the samples delivered.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Number of samples of the whole recording: `floor(duration * rate_hz)`.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Counts of saturated and non-finite values since the start of the recording.
    pub fn counters(&self) -> AdcCounters {
        self.conversion.counters()
    }

    fn fill_converters(&mut self) -> Result<(), RecordingError> {
        while self.conversion.is_starved() {
            if !self.ended {
                self.ended = !self.recording.read_block(&mut self.block)?;
            }
            if self.ended {
                self.conversion.flush()?;
                continue;
            }
            let (block, recording) = (&self.block, &self.recording);
            self.conversion.append(|signal| {
                let microvolts = recording.signals()[signal].unit.microvolts();
                let microvolts = microvolts.unwrap_or(1.0);
                let samples = block.samples[signal].iter();
                samples.map(move |sample| sample * microvolts)
            })?;
        }
        Ok(())
    }
}

impl Iterator for VirtualAdc {
    type Item = Result<[i32; CHANNELS], RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.delivered == self.samples {
            return None;
        }
        if let Err(error) = self.fill_converters() {
            self.delivered = self.samples;
            return Some(Err(error));
        }
        self.delivered += 1;
        Some(Ok(self.conversion.next_counts()))
    }
}

/// Returns `floor(records * record duration * rate)`, computed exactly.
fn sample_count(recording: &Recording, rate_hz: u32) -> u64 {
    let Some(length) = recording.record_duration() else {
        return 0;
    };
    let product =
        u128::from(recording.records()) * u128::from(length.numerator()) * u128::from(rate_hz);
    u64::try_from(product / u128::from(length.denominator())).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests;
