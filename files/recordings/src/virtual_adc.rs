//! Converts a recording to the samples that an ADC would deliver for the same signals.

mod conversion;
mod counts;
pub mod live_adc;
mod low_pass;
mod rate_converter;

use crate::{
    error::RecordingError,
    montage_map::MontageMap,
    recording::{Block, Recording},
};
use conversion::{Conversion, SignalRate};

/// Number of channels of the virtual ADC. Channel e carries electrode e of the montage; channels
/// without an electrode are 0.
pub const CHANNELS: usize = 64;

/// Sampling rate and scale of the virtual ADC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdcSpec {
    /// Sampling rate of each channel, Hz, 1..=100,000.
    pub rate_hz: u32,
    /// Microvolts per count, > 0.
    pub lsb_uv: f64,
}

impl AdcSpec {
    /// Returns a specification with the scale of an ADS1299 at gain 24 with a reference of 4.5 V:
    /// `2 * 4.5 V / 24 / 2^24` = 22.35 nV per count (TI datasheet SBAS499, section 9.5.1).
    pub const fn ads1299(rate_hz: u32) -> Self {
        Self { rate_hz, lsb_uv: 2.0 * 4.5e6 / 24.0 / 16_777_216.0 }
    }
}

/// Numbers of values that the virtual ADC could not represent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AdcCounters {
    /// Number of counts that were clipped to the smallest or largest count.
    pub saturated: u64,
    /// Number of NaN and infinite samples in the recording. Each was replaced by the last finite
    /// sample of its signal, or by 0 if there was none before.
    pub not_finite: u64,
}

impl AdcCounters {
    /// Returns a sentence for the user about each count that is not 0.
    pub fn warnings(self) -> Vec<String> {
        let Self { saturated, not_finite } = self;
        let rail = format!(
            "{saturated} counts are at the rail of the ADC, whose range the signals exceed: check \
             their units and the amplifier"
        );
        let hole = format!(
            "{not_finite} samples are no number (NaN or infinite); each repeats the last number of \
             its signal, or is 0"
        );
        let counted = [(saturated, rail), (not_finite, hole)];
        let counted = counted.into_iter().filter(|(count, _)| *count > 0);
        counted.map(|(_, warning)| warning).collect()
    }
}

/// Plays a recording as an iterator over the samples of a virtual ADC. Each sample has [`CHANNELS`]
/// counts, i24 in i32; sample k is the recording at the time k / `rate_hz`.
///
/// The iterator yields `floor(duration * rate_hz)` samples, or ends after its first error.
///
/// A signal at the rate of the ADC passes unchanged. Signals at other rates are resampled without
/// delay. The pass band ends at 60 Hz or at 0.9 of half the lower rate, whichever is lower.
/// Frequencies above half the lower rate are attenuated by 90 dB; in recordings at 180 to 512 Hz,
/// images of content above 90 Hz are attenuated less (`docs/recordings.md`). Beyond the ends of the
/// file, a signal keeps its first or last value.
///
/// Voltages become counts by `round(uV / lsb_uv)`, ties away from zero, saturating to i24;
/// saturation is counted. Where all eight channels of a chip would repeat their last sample,
/// one count is added, because a driver takes repetition for a failure
/// (`docs/decisions/0017-dither-of-repeated-samples.md`). A signal whose unit is not a voltage is
/// treated as uV, and the recording has a warning about it.
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
    /// [`RecordingError::Range`] if a signal of the map cannot be scaled,
    /// [`RecordingError::Rate`] if a signal cannot be resampled.
    pub fn new(
        mut recording: Recording,
        map: &MontageMap,
        spec: AdcSpec,
    ) -> Result<Self, RecordingError> {
        let signals = recording.signals().iter();
        let signals: Vec<SignalRate> =
            signals.map(|signal| SignalRate { label: &signal.label, rate: signal.rate }).collect();
        let conversion = Conversion::new(&signals, map, spec)?;
        for signal in map.used() {
            let signal = &recording.signals()[signal];
            if let Err(range) = &signal.calibration {
                let (label, range) = (signal.label.clone(), range.clone());
                return Err(RecordingError::Range { label, range });
            }
        }
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

    /// Switches dither off, for users who need the exact conversion of the recording. A driver of
    /// real ADCs would report the undithered repetitions as a frozen chip.
    #[must_use]
    pub fn without_dither(mut self) -> Self {
        self.conversion.dither = None;
        self
    }

    /// Returns the rate and scale that were passed to [`VirtualAdc::new`].
    pub fn spec(&self) -> AdcSpec {
        self.conversion.spec
    }

    /// Returns the recording that is played; its read position is ahead of the delivered samples.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Returns the number of samples of the whole recording: `floor(duration * rate_hz)`.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Returns the numbers of saturated counts and of non-finite samples since the start of the
    /// recording.
    pub fn counters(&self) -> AdcCounters {
        self.conversion.counters
    }

    fn fill_converters(&mut self) -> Result<(), RecordingError> {
        while self.conversion.is_starved() {
            if !self.ended {
                self.ended = !self.recording.read_block(&mut self.block)?;
            }
            if self.ended {
                self.conversion.flush();
                continue;
            }
            let (block, recording) = (&self.block, &self.recording);
            self.conversion.append(|signal| {
                let microvolts = recording.signals()[signal].unit.microvolts();
                let microvolts = microvolts.unwrap_or(1.0);
                let samples = block.samples[signal].iter();
                samples.map(move |sample| sample * microvolts)
            });
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

/// Returns the number of samples in a recording, `floor(records * record duration * rate)`,
/// exactly.
fn sample_count(recording: &Recording, rate_hz: u32) -> u64 {
    let Some(length) = recording.record_duration() else {
        return 0;
    };
    let product =
        u128::from(recording.records()) * u128::from(length.numerator()) * u128::from(rate_hz);
    u64::try_from(product / u128::from(length.denominator())).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::gdf::writer::GdfWriter;
    use crate::header::FileToWrite;
    use crate::montage_map::Missing;

    /// Returns a GDF file of two signals with these rates. All their int16 samples are 1 uV.
    fn file(rates: [u16; 2], seconds: u16) -> Vec<u8> {
        let file = FileToWrite::microvolts(["C3", "C4"], [-32_768.0, 32_767.0], 1, 1);
        let writer = GdfWriter::new(Cursor::new(Vec::new()), &file).expect("a header");
        let mut bytes = writer.finish(&[]).expect("memory").into_inner();
        // The writer supports only one rate and float32, so the test overwrites samples per record
        // and types in the header, and writes its own records in place of the event table.
        bytes.truncate(3 * 256);
        bytes[236..244].copy_from_slice(&i64::from(seconds).to_le_bytes());
        let fields = rates.map(u32::from).into_iter().chain([3, 3]);
        let fields: Vec<u8> = fields.flat_map(u32::to_le_bytes).collect();
        bytes[688..704].copy_from_slice(&fields);
        let per_record: usize = rates.map(usize::from).iter().sum();
        bytes.extend([1, 0].repeat(per_record * usize::from(seconds)));
        bytes
    }

    #[test]
    fn a_rate_group_that_is_ahead_buffers_only_a_few_blocks() {
        // The file lasts 20 minutes. According to measurements, at most 32,768 samples (512 and 160
        // Hz) and 47,348 samples (160 and 250 Hz) are in memory, so 65,536 is the limit. A single
        // block read from the file already holds 48 s (24,576 outputs) or 79 s (40,448 outputs).
        const SECONDS: u16 = 1200;
        for rates in [[512, 160], [160, 250]] {
            let file = Cursor::new(file(rates, SECONDS));
            let recording = Recording::from_source(file).expect("a sound file");
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
            assert_eq!(delivered, usize::from(SECONDS) * 512);
            assert!(most < 65_536, "{rates:?}: {most} of {delivered} samples in memory");
        }
    }
}
