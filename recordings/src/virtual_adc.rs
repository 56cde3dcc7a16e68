//! A recording as the ADC would have seen it.

use crate::{
    Block, MontageMap, Ratio, Recording, RecordingError, montage_map::Origin,
    rate_converter::RateConverter,
};

/// Channels of the ADC; electrode e of the montage lies on channel e, the others read 0.
pub const CHANNELS: usize = 64;

/// The rails of a 24-bit ADC, counts.
const RAILS: std::ops::RangeInclusive<f64> = -8_388_608.0..=8_388_607.0;

/// Largest number that goes into the resampler, uV: far beyond every rail, and no sum in a
/// transform of it overflows, which the resampler answers with a panic.
const LARGEST_UV: f64 = 1e100;

/// The ADC's rate and scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdcSpec {
    /// Samples per second, Hz, 1..=100,000.
    pub rate_hz: u32,
    /// uV per count, > 0.
    pub lsb_uv: f64,
}

impl AdcSpec {
    /// An ADS1299 at gain 24 and 4.5 V: `2 * 4.5 V / 24 / 2^24` = 22.35 nV per count
    /// (TI SBAS499, section 9.5.1).
    pub const fn ads1299(rate_hz: u32) -> Self {
        Self {
            rate_hz,
            lsb_uv: 2.0 * 4.5e6 / 24.0 / 16_777_216.0,
        }
    }
}

/// What the conversion could not represent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AdcCounters {
    /// Counts that were limited to a rail.
    pub saturated: u64,
    /// Samples of the recording that were no number; the last number was held instead.
    pub not_finite: u64,
}

/// Plays a recording through a virtual ADC: an iterator over samples of [`CHANNELS`] counts,
/// i24 in i32, sample k being the recording at k / `rate_hz` s.
///
/// It gives `floor(duration * rate_hz)` samples. A signal at the ADC's rate passes unchanged;
/// others are resampled band-limited and without delay (see `rate_converter` for the ends of
/// the file). Volts become counts by `round(uV / lsb_uv)`, ties away from zero, saturating to i24
/// and counted. A signal whose unit is no voltage is taken as uV (the recording warns of it).
/// The iterator ends after its first error.
pub struct VirtualAdc {
    recording: Recording,
    spec: AdcSpec,
    groups: Vec<RateGroup>,
    /// Per electrode: group, line and weight of everything it is mixed from.
    mixes: Vec<Vec<(usize, usize, f64)>>,
    block: Block,
    ended: bool,
    samples: u64,
    given: u64,
    counters: AdcCounters,
}

/// The signals of one rate.
struct RateGroup {
    signals: Vec<usize>,
    converter: RateConverter,
    /// The last number of each signal, uV.
    held: Vec<f64>,
}

impl VirtualAdc {
    /// A virtual ADC at the first record of `recording`.
    ///
    /// # Errors
    /// [`RecordingError::AdcSpec`], [`RecordingError::ForeignMap`], [`RecordingError::Rate`].
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
                let (group, line) = place_of(signal, &recording, &mut rates, spec)?;
                mix.push((group, line, weight));
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
        let samples = samples_in(&recording, spec.rate_hz);
        let (block, counters) = (Block::default(), AdcCounters::default());
        Ok(Self {
            recording,
            spec,
            groups,
            mixes,
            block,
            ended: false,
            samples,
            given: 0,
            counters,
        })
    }

    /// The ADC's rate and scale.
    pub fn spec(&self) -> AdcSpec {
        self.spec
    }

    /// The recording that is played.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Samples that the whole recording gives: `floor(duration * rate_hz)`.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// What could not be represented so far.
    pub fn counters(&self) -> AdcCounters {
        self.counters
    }

    fn fill(&mut self) -> Result<(), RecordingError> {
        while self.groups.iter().any(|group| group.converter.ready() == 0) {
            if !self.ended {
                self.ended = !self.recording.read_block(&mut self.block)?;
            }
            for group in &mut self.groups {
                if self.ended {
                    group.converter.flush(&group.held)?;
                } else {
                    self.counters.not_finite += group.append(&self.block, &self.recording);
                    group.converter.convert()?;
                }
            }
        }
        Ok(())
    }

    fn counts(&mut self) -> [i32; CHANNELS] {
        let mut counts = [0; CHANNELS];
        for (count, mix) in counts.iter_mut().zip(&self.mixes) {
            let parts = mix
                .iter()
                .map(|&(group, line, weight)| self.groups[group].converter.peek(line) * weight);
            let steps = (parts.sum::<f64>() / self.spec.lsb_uv).round();
            let limited = steps.clamp(*RAILS.start(), *RAILS.end());
            self.counters.saturated += u64::from(!RAILS.contains(&steps));
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
        if self.given == self.samples {
            return None;
        }
        if let Err(error) = self.fill() {
            self.given = self.samples;
            return Some(Err(error));
        }
        self.given += 1;
        let counts = self.counts();
        for group in &mut self.groups {
            group.converter.advance();
        }
        Some(Ok(counts))
    }
}

impl RateGroup {
    /// Appends a block's samples, in uV; returns how many were no number.
    fn append(&mut self, block: &Block, recording: &Recording) -> u64 {
        let mut not_finite = 0;
        for (line, &signal) in self.signals.iter().enumerate() {
            let microvolts = recording.signals()[signal].unit.microvolts().unwrap_or(1.0);
            let held = &mut self.held[line];
            self.converter
                .line(line)
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

/// Group and line of a signal, both made if they are new.
fn place_of(
    signal: usize,
    recording: &Recording,
    rates: &mut Vec<(Ratio, Vec<usize>)>,
    spec: AdcSpec,
) -> Result<(usize, usize), RecordingError> {
    let signals = recording.signals().len();
    let described = recording
        .signals()
        .get(signal)
        .ok_or(RecordingError::ForeignMap { signal, signals })?;
    let rate = described
        .rate
        .ok_or_else(|| rate_error(recording, signal, spec, "the recording has no sample of it"))?;
    let group = rates
        .iter()
        .position(|(other, _)| *other == rate)
        .unwrap_or_else(|| {
            rates.push((rate, Vec::new()));
            rates.len() - 1
        });
    let lines = &mut rates[group].1;
    let line = lines
        .iter()
        .position(|&other| other == signal)
        .unwrap_or_else(|| {
            lines.push(signal);
            lines.len() - 1
        });
    Ok((group, line))
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

/// `floor(records * record length * rate)`, exactly.
fn samples_in(recording: &Recording, rate_hz: u32) -> u64 {
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
    use crate::Missing;

    /// An EDF file of two signals, `records` s long: `rates` samples per record, all 1 step.
    fn two_rates(records: usize, rates: [usize; 2]) -> Vec<u8> {
        let mut file = Vec::new();
        let mut put = |text: &str, width: usize| file.extend(format!("{text:width$}").bytes());
        put("0", 8);
        put("", 160);
        put("01.01.2400.00.00", 16);
        put("768", 8 + 44);
        put(&records.to_string(), 8);
        put("1", 8);
        put("2", 4);
        put("C3", 16);
        put("C4", 16);
        put("", 160);
        for field in ["uV", "-32768", "32767", "-32768", "32767"] {
            put(field, 8);
            put(field, 8);
        }
        put("", 160);
        for rate in rates {
            put(&rate.to_string(), 8);
        }
        put("", 64);
        let samples = records * (rates[0] + rates[1]);
        file.extend([1, 0].repeat(samples));
        file
    }

    #[test]
    fn a_group_that_runs_ahead_keeps_no_more_than_a_few_blocks() {
        // 20 minutes. Measured: 32,768 and 47,348 samples; a block of the file alone is 48 s (24,576
        // outputs) or 79 s (40,448).
        const RECORDS: usize = 1200;
        for rates in [[512, 160], [160, 250]] {
            let bytes = two_rates(RECORDS, rates);
            let recording = Recording::from_source(Cursor::new(bytes)).expect("a sound file");
            let map = MontageMap::new(&recording.labels(), &["C3", "C4"], Missing::Refuse);
            let map = map.expect("both are there");
            let mut adc = VirtualAdc::new(recording, &map, AdcSpec::ads1299(512)).expect("usable");
            let (mut most, mut given) = (0, 0);
            while let Some(counts) = adc.next() {
                // 1 uV is 44.7 counts.
                assert_eq!(counts.expect("readable")[..2], [45, 45]);
                let held = adc.groups.iter().map(|group| group.converter.held());
                most = most.max(held.max().unwrap_or(0));
                given += 1;
            }
            assert_eq!(given, RECORDS * 512);
            assert!(most < 65_536, "{rates:?}: {most} of {given} samples held");
        }
    }
}
