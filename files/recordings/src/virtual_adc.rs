//! Converts a recording to the samples that an ADC would have delivered.

mod conversion;
mod counts;
pub mod live_adc;
mod rate_converter;

use crate::{
    error::RecordingError,
    montage_map::MontageMap,
    recording::{Block, Recording},
};
use conversion::{Conversion, SignalRate};

/// Number of channels of the ADC. Channel e carries electrode e of the montage; channels without an
/// electrode are 0.
pub const CHANNELS: usize = 64;

/// Sampling rate and scale of the virtual ADC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdcSpec {
    /// Sampling rate, Hz, 1..=100,000.
    pub rate_hz: u32,
    /// Scale: uV per count, > 0.
    pub lsb_uv: f64,
}

impl AdcSpec {
    /// Returns a specification with the scale of an ADS1299 at gain 24 with a reference of 4.5 V:
    /// `2 * 4.5 V / 24 / 2^24` = 22.35 nV per count (TI data sheet SBAS499, section 9.5.1).
    pub const fn ads1299(rate_hz: u32) -> Self {
        Self {
            rate_hz,
            lsb_uv: 2.0 * 4.5e6 / 24.0 / 16_777_216.0,
        }
    }
}

/// Counts of values that the conversion could not represent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AdcCounters {
    /// Number of outputs limited to the smallest or largest count.
    pub saturated: u64,
    /// Number of NaN and infinite samples in the recording; each was replaced by the signal's last
    /// finite sample, or by 0 before the first one.
    pub not_finite: u64,
}

/// Iterator over the samples of a virtual ADC that plays a recording. Each sample has [`CHANNELS`]
/// counts, i24 in i32; sample k is the recording at the time k / `rate_hz`.
///
/// The iterator yields `floor(duration * rate_hz)` samples, or ends after its first error. A signal
/// at the rate of the ADC passes unchanged. Signals at other rates are resampled, band-limited and
/// without delay; beyond the ends of the file, a signal keeps its first or last value. Voltages
/// become counts by `round(uV / lsb_uv)`, ties away from zero, saturating to i24; saturation is
/// counted. Where all eight channels of a converter would repeat their last sample, one count is
/// added (`docs/decisions/0017-dither-of-repeated-samples.md`). A signal whose unit is not a
/// voltage is treated as uV, and the recording has a warning about it.
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
    /// [`RecordingError::MapMismatch`] if `map` belongs to another recording,
    /// [`RecordingError::Rate`] if a signal cannot be resampled.
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

    /// Leaves repeated samples as they are, for counts that are the exact conversion of the
    /// recording. A driver of real converters reports such samples as a frozen chip.
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
#[allow(dead_code, reason = "the integration tests build all kinds of files")]
#[path = "../tests/it/files.rs"]
mod files;

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::{
        files::{EdfFile, EdfSignal},
        *,
    };
    use crate::montage_map::Missing;

    #[test]
    fn a_rate_group_that_is_ahead_buffers_only_a_few_blocks() {
        // The file lasts 20 minutes. At most 32,768 (512 and 160 Hz) and 47,348 samples (160 and
        // 250 Hz) were measured in memory; the limit below is 65,536. One block read from the file
        // alone is 48 s (24,576 outputs) or 79 s (40,448).
        const RECORDS: usize = 1200;
        for rates in [[512, 160], [160, 250]] {
            let [c3, c4] = rates.map(|rate| vec![1; RECORDS * rate]);
            let signals = vec![
                EdfSignal::int16("C3", rates[0], &c3),
                EdfSignal::int16("C4", rates[1], &c4),
            ];
            let bytes = EdfFile::edf("1200", signals).bytes();
            let recording = Recording::from_source(Cursor::new(bytes)).expect("a sound file");
            let map = MontageMap::new(&recording.labels(), &["C3", "C4"], Missing::Refuse);
            let map = map.expect("both are there");
            let adc = VirtualAdc::new(recording, &map, AdcSpec::ads1299(512));
            let mut adc = adc.expect("usable").without_dither();
            let (mut most, mut delivered) = (0, 0);
            while let Some(counts) = adc.next() {
                // 1 uV is 44.7 counts of 22.35 nV, which rounds to 45.
                assert_eq!(counts.expect("readable")[..2], [45, 45]);
                most = most.max(adc.conversion.queued_samples());
                delivered += 1;
            }
            assert_eq!(delivered, RECORDS * 512);
            assert!(
                most < 65_536,
                "{rates:?}: {most} of {delivered} samples in memory"
            );
        }
    }
}
