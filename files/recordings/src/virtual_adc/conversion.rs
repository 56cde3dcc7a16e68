//! Resamples signals, mixes them to electrodes and converts the electrodes to counts.

use crate::{
    error::RecordingError,
    montage_map::{MontageMap, Origin},
    ratio::Ratio,
};

use super::counts::{CountBlock, Dither};
use super::rate_converter::RateConverter;
use super::{AdcCounters, AdcSpec, CHANNELS};

/// Limit for the magnitude of values passed to the resampler, uV. It is far beyond the ADC's range,
/// but so small that no sum of the resampler or of a mix overflows to infinity, and then to NaN.
const LARGEST_UV: f64 = 1e100;

/// Label and sampling rate of a signal of the recording.
pub(super) struct SignalRate<'a> {
    pub(super) label: &'a str,
    /// Sampling rate, Hz; `None` if the signal has no samples.
    pub(super) rate: Option<Ratio>,
}

/// Converts the signals of a recording, in uV, to samples of the virtual ADC.
pub(super) struct Conversion {
    pub(super) spec: AdcSpec,
    groups: Vec<RateGroup>,
    /// For each electrode, the signals and weights whose weighted sum is the electrode's value.
    mixes: Vec<Vec<MixTerm>>,
    /// Samples converted to counts but not delivered yet; boxed, because the block is large.
    converted: Box<CountBlock>,
    /// Dither of repeated counts; `None` to convert exactly.
    pub(super) dither: Option<Dither>,
    pub(super) counters: AdcCounters,
}

/// A signal and its weight in the sum that forms an electrode's value.
struct MixTerm {
    group: usize,
    /// Index of the signal within its rate group.
    member: usize,
    weight: f64,
}

/// All signals of one sampling rate, which share a rate converter.
struct RateGroup {
    signals: Vec<usize>,
    converter: RateConverter,
    /// Last finite sample of each signal in the group, uV.
    held: Vec<f64>,
}

impl Conversion {
    /// Creates the conversion of `signals` to the electrodes of `map`.
    ///
    /// # Errors
    /// [`RecordingError::AdcSpec`], [`RecordingError::TooManyElectrodes`],
    /// [`RecordingError::MapMismatch`], [`RecordingError::NoSamples`] and [`RecordingError::Rate`].
    pub(super) fn new(
        signals: &[SignalRate],
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
            return Err(RecordingError::TooManyElectrodes { electrodes, channels: CHANNELS });
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
                let (group, member) = find_or_add(signal, signals, &mut rates)?;
                mix.push(MixTerm { group, member, weight });
            }
            mixes.push(mix);
        }
        let mut groups = Vec::with_capacity(rates.len());
        for (rate, members) in rates {
            let label = signals[members[0]].label;
            let converter = RateConverter::new(label, rate, spec.rate_hz, members.len())?;
            let held = vec![0.0; members.len()];
            groups.push(RateGroup { signals: members, converter, held });
        }
        Ok(Self {
            spec,
            groups,
            mixes,
            converted: Box::new(CountBlock::new()),
            dither: Some(Dither::new()),
            counters: AdcCounters::default(),
        })
    }

    /// Returns whether the next sample cannot be computed before more input is appended.
    pub(super) fn is_starved(&self) -> bool {
        self.converted.is_empty() && self.ready() == 0
    }

    /// Returns the number of samples that all groups can resample from the input appended so far.
    fn ready(&self) -> usize {
        let ready = self.groups.iter().map(|group| group.converter.ready());
        ready.min().unwrap_or(usize::MAX)
    }

    /// Appends samples to all signals. `samples` returns the new samples of the signal with the
    /// given index, uV.
    pub(super) fn append<S: Iterator<Item = f64>>(&mut self, samples: impl Fn(usize) -> S) {
        for group in &mut self.groups {
            self.counters.not_finite += group.append(&samples);
        }
    }

    /// Extends every signal by `samples` repetitions of its last finite sample.
    pub(super) fn hold(&mut self, samples: usize) {
        for group in &mut self.groups {
            group.hold(samples);
        }
    }

    /// Extends every signal by repetitions of its last finite sample, as many as its resampler
    /// waits for. After the last record, this yields the remaining outputs.
    pub(super) fn flush(&mut self) {
        for group in &mut self.groups {
            group.hold(group.converter.delay().max(1));
        }
    }

    /// Returns the next sample. The caller must have checked that [`Self::is_starved`] is false.
    pub(super) fn next_counts(&mut self) -> [i32; CHANNELS] {
        if self.converted.is_empty() {
            self.convert_to_counts();
        }
        let (mut counts, saturated) = self.converted.next();
        self.counters.saturated += saturated;
        if let Some(dither) = &mut self.dither {
            dither.apply(&mut counts);
        }
        counts
    }

    /// Converts the next resampled values of all electrodes to a block of counts.
    fn convert_to_counts(&mut self) {
        let samples = self.converted.start(self.ready());
        for group in &mut self.groups {
            group.converter.convert(samples);
        }
        for (channel, mix) in self.mixes.iter().enumerate() {
            let terms = mix.iter().map(|term| {
                let converter = &self.groups[term.group].converter;
                (converter.outputs(term.member, samples), term.weight)
            });
            self.converted.convert(channel, terms, self.spec.lsb_uv);
        }
    }

    /// Returns the longest wait of a resampler for later input, in samples; 0 without a resampler.
    pub(super) fn delay(&self) -> usize {
        let delays = self.groups.iter().map(|group| group.converter.delay());
        delays.max().unwrap_or(0)
    }

    /// Returns the largest number of samples that are in memory for one signal.
    #[cfg(test)]
    pub(super) fn queued_samples(&self) -> usize {
        let groups = self.groups.iter();
        let queued = groups.map(|group| group.converter.queued_samples());
        queued.max().unwrap_or(0)
    }
}

impl RateGroup {
    /// Appends samples, uV, to the group's signals. Returns the number of NaN and infinite samples.
    fn append<S: Iterator<Item = f64>>(&mut self, samples: &impl Fn(usize) -> S) -> u64 {
        let mut not_finite = 0;
        for (member, &signal) in self.signals.iter().enumerate() {
            let held = &mut self.held[member];
            let finite = samples(signal).map(|uv| {
                if uv.is_finite() {
                    *held = uv.clamp(-LARGEST_UV, LARGEST_UV);
                } else {
                    not_finite += 1;
                }
                *held
            });
            self.converter.append(member, finite);
        }
        not_finite
    }

    /// Appends `samples` repetitions of each signal's last finite sample.
    fn hold(&mut self, samples: usize) {
        for (member, &value) in self.held.iter().enumerate() {
            let held = std::iter::repeat_n(value, samples);
            self.converter.append(member, held);
        }
    }
}

/// Returns the index of a signal's rate group, and the index of the signal within the group. Adds
/// the group and the signal if they are new.
fn find_or_add(
    signal: usize,
    signals: &[SignalRate],
    rates: &mut Vec<(Ratio, Vec<usize>)>,
) -> Result<(usize, usize), RecordingError> {
    let described = signals
        .get(signal)
        .ok_or(RecordingError::MapMismatch { signal, signals: signals.len() })?;
    let no_samples = || RecordingError::NoSamples { label: described.label.to_owned() };
    let rate = described.rate.ok_or_else(no_samples)?;
    let group = rates.iter().position(|(other, _)| *other == rate).unwrap_or_else(|| {
        rates.push((rate, Vec::new()));
        rates.len() - 1
    });
    let members = &mut rates[group].1;
    let member = members.iter().position(|&other| other == signal).unwrap_or_else(|| {
        members.push(signal);
        members.len() - 1
    });
    Ok((group, member))
}
