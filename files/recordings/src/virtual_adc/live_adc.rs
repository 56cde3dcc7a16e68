//! The virtual ADC for samples that arrive in real time.

use crate::{error::RecordingError, montage_map::MontageMap, ratio::Ratio};

use super::conversion::{Conversion, SignalRate};
use super::{AdcCounters, AdcSpec, CHANNELS};

/// Converts samples to ADC counts as they arrive. The counts equal those that
/// [`VirtualAdc`](super::VirtualAdc) yields for a recording of the same samples, bit for bit.
///
/// Input at the rate of the ADC is converted at once. At other rates, an output sample waits for
/// the [`LiveAdc::delay`] input samples after it.
///
/// ```
/// use recordings::{AdcSpec, LiveAdc, Missing, MontageMap};
///
/// let labels = ["Cz", "Pz"];
/// let map = MontageMap::new(&labels, &["Pz"], Missing::Interpolate)?;
/// let mut adc = LiveAdc::new(&labels, 512, &map, AdcSpec::ads1299(512))?;
/// adc.append(&[0.0, 100.0]);
/// // 100 uV at 22.35 nV per count.
/// assert_eq!(adc.next_sample().map(|counts| counts[0]), Some(4474));
/// assert_eq!(adc.next_sample(), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LiveAdc {
    conversion: Conversion,
    signals: usize,
}

impl LiveAdc {
    /// Creates a virtual ADC for the signals `labels`, which all have the rate `rate_hz`. `map`
    /// must have been created from the same labels.
    ///
    /// # Errors
    /// The errors of [`VirtualAdc::new`](super::VirtualAdc::new).
    pub fn new<L: AsRef<str>>(
        labels: &[L],
        rate_hz: u32,
        map: &MontageMap,
        spec: AdcSpec,
    ) -> Result<Self, RecordingError> {
        let rate = Ratio::new(rate_hz.into(), 1);
        let signals = labels.iter().map(AsRef::as_ref);
        let signals: Vec<SignalRate> = signals.map(|label| SignalRate { label, rate }).collect();
        let conversion = Conversion::new(&signals, map, spec)?;
        Ok(Self { conversion, signals: labels.len() })
    }

    /// Appends samples, uV: the first sample of all signals, then the second, and so on. Ignores an
    /// incomplete last sample.
    pub fn append(&mut self, samples: &[f32]) {
        let signals = self.signals;
        self.conversion.append(|signal| {
            let rows = samples.chunks_exact(signals);
            rows.map(move |row| f64::from(row[signal]))
        });
    }

    /// Replaces lost samples: appends `samples` repetitions of each signal's last finite sample.
    pub fn hold(&mut self, samples: usize) {
        self.conversion.hold(samples);
    }

    /// Returns the next sample of the ADC, or `None` until more samples have been appended. Sample
    /// k is the input at the time k / [`AdcSpec::rate_hz`].
    pub fn next_sample(&mut self) -> Option<[i32; CHANNELS]> {
        (!self.conversion.is_starved()).then(|| self.conversion.next_counts())
    }

    /// Returns the largest number of input samples from the time of an output sample to the last
    /// input sample that it depends on; 0 if nothing is resampled.
    pub fn delay(&self) -> usize {
        self.conversion.delay()
    }

    /// Returns the numbers of saturated counts and of non-finite samples since the first sample.
    pub fn counters(&self) -> AdcCounters {
        self.conversion.counters
    }
}
