//! Converts a recording to the samples that an ADC would have delivered.

mod dither;
mod rails;
mod rate_converter;

use crate::{
    error::RecordingError,
    montage_map::{MontageMap, Origin},
    ratio::Ratio,
    recording::{Block, Recording},
};
use dither::Dither;
use rails::RAILS;
use rate_converter::RateConverter;

/// Number of channels of the ADC. Channel e carries electrode e of the montage; channels without an
/// electrode are 0.
pub const CHANNELS: usize = 64;

/// Largest magnitude passed to the resampler, uV. It is far beyond the ADC's range, and small enough
/// that no sum in a transform overflows; the resampler would panic on an overflow.
const LARGEST_UV: f64 = 1e100;

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
/// The iterator yields `floor(duration * rate_hz)` samples, or ends after its first error. A signal at
/// the rate of the ADC passes unchanged. Signals at other rates are resampled, band-limited and without
/// delay; beyond the ends of the file, a signal keeps its first or last value. Voltages become counts by
/// `round(uV / lsb_uv)`, ties away from zero, saturating to i24; saturation is counted. Where all eight
/// channels of a converter would repeat their last sample, one count is added
/// (`docs/decisions/0017-dither-of-repeated-samples.md`). A signal whose unit is not a voltage is treated as uV, and the recording has a warning about it.
pub struct VirtualAdc {
    recording: Recording,
    spec: AdcSpec,
    groups: Vec<RateGroup>,
    /// Terms of each electrode; the value of an electrode is the sum of its weighted signals.
    mixes: Vec<Vec<MixTerm>>,
    /// `None` for the exact conversion.
    dither: Option<Dither<CHANNELS>>,
    block: Block,
    ended: bool,
    samples: u64,
    delivered: u64,
    counters: AdcCounters,
}

/// A weighted signal in the mix of an electrode.
struct MixTerm {
    group: usize,
    /// Index of the signal within its group.
    member: usize,
    weight: f64,
}

/// The signals of one sampling rate, which share a converter.
struct RateGroup {
    signals: Vec<usize>,
    converter: RateConverter,
    /// Last finite sample of each signal, uV.
    held: Vec<f64>,
}

impl VirtualAdc {
    /// Creates a virtual ADC that starts at the first record of `recording`.
    ///
    /// # Errors
    /// [`RecordingError::AdcSpec`] if the rate or scale is out of range,
    /// [`RecordingError::TooManyElectrodes`] if the montage has more than [`CHANNELS`] electrodes,
    /// [`RecordingError::MapMismatch`] if `map` belongs to another recording,
    /// [`RecordingError::NoSamples`] if a signal of the map has none, [`RecordingError::Rate`] if a signal
    /// cannot be resampled.
    pub fn new(
        mut recording: Recording,
        map: &MontageMap,
        spec: AdcSpec,
    ) -> Result<Self, RecordingError> {
        let scale_is_usable = spec.lsb_uv.is_finite() && spec.lsb_uv > 0.0;
        if !scale_is_usable || !(1..=100_000).contains(&spec.rate_hz) {
            let AdcSpec { rate_hz, lsb_uv } = spec;
            return Err(RecordingError::AdcSpec { rate_hz, lsb_uv });
        }
        if map.origins().len() > CHANNELS {
            let electrodes = map.origins().len();
            return Err(RecordingError::TooManyElectrodes {
                electrodes,
                channels: CHANNELS,
            });
        }
        let mut rates: Vec<(Ratio, Vec<usize>)> = Vec::new();
        let mut mixes = Vec::with_capacity(map.origins().len());
        for origin in map.origins() {
            let sources = match origin {
                Origin::Real(signal) => vec![(*signal, 1.0)],
                Origin::Interpolated(mix) => mix.clone(),
                Origin::Zero => Vec::new(),
            };
            let mut mix = Vec::with_capacity(sources.len());
            for (signal, weight) in sources {
                let (group, member) = find_or_add(signal, &recording, &mut rates)?;
                mix.push(MixTerm {
                    group,
                    member,
                    weight,
                });
            }
            mixes.push(mix);
        }
        let mut groups = Vec::with_capacity(rates.len());
        for (rate, signals) in rates {
            let converter = RateConverter::new(rate, spec.rate_hz, signals.len())?
                .map_err(|reason| rate_error(&recording, signals[0], spec, reason))?;
            let held = vec![0.0; signals.len()];
            groups.push(RateGroup {
                signals,
                converter,
                held,
            });
        }
        recording.rewind();
        let samples = sample_count(&recording, spec.rate_hz);
        let (block, counters) = (Block::default(), AdcCounters::default());
        Ok(Self {
            recording,
            spec,
            groups,
            mixes,
            dither: Some(Dither::new()),
            block,
            ended: false,
            samples,
            delivered: 0,
            counters,
        })
    }

    /// Leaves repeated samples as they are, for counts that are the exact conversion of the recording. A
    /// driver of real converters takes such samples for a frozen chip.
    #[must_use]
    pub fn without_dither(mut self) -> Self {
        self.dither = None;
        self
    }

    /// Rate and scale that were passed to [`VirtualAdc::new`].
    pub fn spec(&self) -> AdcSpec {
        self.spec
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
        self.counters
    }

    fn fill_converters(&mut self) -> Result<(), RecordingError> {
        while self.groups.iter().any(|group| group.converter.ready() == 0) {
            if !self.ended {
                self.ended = !self.recording.read_block(&mut self.block)?;
            }
            for group in &mut self.groups {
                if self.ended {
                    group.converter.flush(&group.held)?;
                } else {
                    self.counters.not_finite += group.append_block(&self.block, &self.recording);
                    group.converter.convert()?;
                }
            }
        }
        Ok(())
    }

    fn convert_to_counts(&mut self) -> [i32; CHANNELS] {
        let mut counts = [0; CHANNELS];
        for (count, mix) in counts.iter_mut().zip(&self.mixes) {
            let terms = mix
                .iter()
                .map(|term| self.groups[term.group].converter.peek(term.member) * term.weight);
            let unlimited = (terms.sum::<f64>() / self.spec.lsb_uv).round();
            let limited = unlimited.clamp(*RAILS.start(), *RAILS.end());
            self.counters.saturated += u64::from(!RAILS.contains(&unlimited));
            #[expect(clippy::cast_possible_truncation, reason = "whole and within i24")]
            let value = limited as i32;
            *count = value;
        }
        counts
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
        let mut counts = self.convert_to_counts();
        if let Some(dither) = &mut self.dither {
            dither.apply(&mut counts);
        }
        for group in &mut self.groups {
            group.converter.advance();
        }
        Some(Ok(counts))
    }
}

impl RateGroup {
    /// Appends the samples of a block, converted to uV. Returns the number of non-finite samples.
    fn append_block(&mut self, block: &Block, recording: &Recording) -> u64 {
        let mut not_finite = 0;
        for (member, &signal) in self.signals.iter().enumerate() {
            let microvolts = recording.signals()[signal].unit.microvolts().unwrap_or(1.0);
            let held = &mut self.held[member];
            self.converter
                .queue_mut(member)
                .extend(block.samples[signal].iter().map(|sample| {
                    let uv = sample * microvolts;
                    if uv.is_finite() {
                        *held = uv.clamp(-LARGEST_UV, LARGEST_UV);
                    } else {
                        not_finite += 1;
                    }
                    *held
                }));
        }
        not_finite
    }
}

/// Returns the index of the rate group of a signal, and the index of the signal within the group. Adds
/// the group and the signal if they are new.
fn find_or_add(
    signal: usize,
    recording: &Recording,
    rates: &mut Vec<(Ratio, Vec<usize>)>,
) -> Result<(usize, usize), RecordingError> {
    let signals = recording.signals().len();
    let described = recording
        .signals()
        .get(signal)
        .ok_or(RecordingError::MapMismatch { signal, signals })?;
    let no_samples = || RecordingError::NoSamples {
        label: described.label.clone(),
    };
    let rate = described.rate.ok_or_else(no_samples)?;
    let group = rates
        .iter()
        .position(|(other, _)| *other == rate)
        .unwrap_or_else(|| {
            rates.push((rate, Vec::new()));
            rates.len() - 1
        });
    let members = &mut rates[group].1;
    let member = members
        .iter()
        .position(|&other| other == signal)
        .unwrap_or_else(|| {
            members.push(signal);
            members.len() - 1
        });
    Ok((group, member))
}

fn rate_error(
    recording: &Recording,
    signal: usize,
    spec: AdcSpec,
    reason: &'static str,
) -> RecordingError {
    let described = &recording.signals()[signal];
    RecordingError::Rate {
        label: described.label.clone(),
        rate: described
            .rate
            .map_or_else(|| "no".to_owned(), |rate| rate.to_string()),
        rate_hz: spec.rate_hz,
        reason,
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
