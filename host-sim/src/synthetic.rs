//! Synthetic EEG: seeded, endless, in the counts that the ADC gives.
//!
//! The sum of: a 1/f^1.5 background of smooth sources under the scalp (`background`), posterior
//! alpha that waxes and wanes (`alpha`), blinks (`blink`), mains, slow drift on an electrode
//! offset (`interference`) and, on request, episodes at the ADC's rail (`rail`). Each part draws
//! from its own random stream, so switching blinks or rails off leaves the others as they are.
//!
//! The same spec gives the same counts on every platform: samples are computed with `+ - * /` and
//! square roots, which IEEE 754 rounds exactly, and ChaCha8. Only the electrodes' positions
//! use the platform's sines; what is derived from them is rounded to 2^-20 (see `scalp`).

mod alpha;
mod background;
mod blink;
mod interference;
mod noise;
mod rail;
mod rotor;
mod scalp;
#[cfg(test)]
mod tests;

use recordings::{AdcSpec, virtual_adc::CHANNELS};
use thiserror::Error;

use self::{
    alpha::Alpha, background::Background, blink::Blinks, interference::Interference, noise::Noise,
    rail::Rails, scalp::Scalp,
};

/// The rails of a 24-bit ADC, counts.
const RAILS: std::ops::RangeInclusive<f64> = -8_388_608.0..=8_388_607.0;

/// What to synthesise. Amplitudes of 0 switch a part off.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticSpec {
    /// Same seed, same counts.
    pub seed: u64,
    /// Samples per second, Hz, 128..=16,000.
    pub rate_hz: u32,
    /// Labels of the 10-5 system; electrode e lies on ADC channel e.
    pub electrodes: Vec<String>,
    /// Background, uV RMS within 0.5-60 Hz; single electrodes have 0.7 to 1.3 times as much.
    pub background_uv: f64,
    /// Alpha over the back of the head within a burst, uV RMS.
    pub alpha_uv: f64,
    /// Mains frequency, Hz, > 0 and below half the rate.
    pub mains_hz: u32,
    /// Mean amplitude (peak) of the mains, uV; single electrodes have 0.5 to 1.5 times as much.
    pub mains_uv: f64,
    /// Largest electrode offset, mV, either sign.
    pub offset_mv: f64,
    /// Slow drift on top of the offset, uV RMS.
    pub drift_uv: f64,
    /// Whether there are blinks: 150 to 300 uV at Fpz, every 2 to 7 s.
    pub blinks: bool,
    /// Whether single electrodes go to the rail: 0.2 to 1.5 s, every 5 to 20 s.
    pub rails: bool,
}

impl SyntheticSpec {
    /// A recording at rest at 512 Hz, near 50 Hz mains, with blinks and without rails. Slope and
    /// spatial correlation are those of a real cap (EEGMMIDB S001R03: 1/f^1.6 from 2 to 40 Hz);
    /// with alpha and blinks it has 24 to 46 uV RMS after 0.5-60 Hz (seed 7, 120 s).
    pub fn new(seed: u64, electrodes: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self {
            seed,
            rate_hz: 512,
            electrodes: electrodes.into_iter().map(Into::into).collect(),
            background_uv: 20.0,
            alpha_uv: 20.0,
            mains_hz: 50,
            mains_uv: 20.0,
            offset_mv: 20.0,
            drift_uv: 100.0,
            blinks: true,
            rails: false,
        }
    }
}

/// Why a spec cannot be synthesised.
#[derive(Debug, Error, PartialEq)]
pub enum SyntheticError {
    /// A label is not in the 10-5 system.
    #[error(
        "{label:?} is no electrode of the 10-20, 10-10 or 10-5 system, so it has no place on the scalp"
    )]
    UnknownElectrode {
        /// The label.
        label: String,
    },
    /// More electrodes than the ADC has channels.
    #[error("{electrodes} electrodes do not fit the ADC's {CHANNELS} channels")]
    TooManyElectrodes {
        /// How many were asked for.
        electrodes: usize,
    },
    /// Rate or mains frequency outside what the generator is made for.
    #[error(
        "{rate_hz} Hz with {mains_hz} Hz mains cannot be synthesised; give 128..=16000 Hz and a mains frequency below half of it"
    )]
    Rate {
        /// Asked rate, Hz.
        rate_hz: u32,
        /// Asked mains frequency, Hz.
        mains_hz: u32,
    },
    /// An amplitude that is negative or no number.
    #[error("{name} is {value}; amplitudes have to be 0 or more")]
    Amplitude {
        /// The field of the spec.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// The generator: an endless iterator over samples of 64 counts, i24 in i32.
#[derive(Debug, Clone)]
pub struct Generator {
    lsb_uv: f64,
    electrodes: usize,
    background: Background,
    alpha: Alpha,
    blinks: Option<Blinks>,
    interference: Interference,
    rails: Option<Rails>,
    saturated: u64,
}

impl Generator {
    /// A generator at its first sample.
    ///
    /// # Errors
    /// [`SyntheticError`], one variant for each field that can be wrong.
    pub fn new(spec: &SyntheticSpec) -> Result<Self, SyntheticError> {
        let SyntheticSpec {
            rate_hz, mains_hz, ..
        } = *spec;
        if !(128..=16_000).contains(&rate_hz) || mains_hz == 0 || mains_hz >= rate_hz / 2 {
            return Err(SyntheticError::Rate { rate_hz, mains_hz });
        }
        for (name, value) in [
            ("background_uv", spec.background_uv),
            ("alpha_uv", spec.alpha_uv),
            ("mains_uv", spec.mains_uv),
            ("offset_mv", spec.offset_mv),
            ("drift_uv", spec.drift_uv),
        ] {
            if !value.is_finite() || value < 0.0 {
                return Err(SyntheticError::Amplitude { name, value });
            }
        }
        let electrodes = spec.electrodes.len();
        if electrodes > CHANNELS {
            return Err(SyntheticError::TooManyElectrodes { electrodes });
        }
        let scalp = Scalp::new(&spec.electrodes)?;
        let rate = f64::from(rate_hz);
        let noise = |stream| Noise::new(spec.seed, stream);
        Ok(Self {
            lsb_uv: AdcSpec::ads1299(rate_hz).lsb_uv,
            electrodes,
            background: Background::new(noise(1), &scalp, rate, spec.background_uv),
            alpha: Alpha::new(noise(2), &scalp, rate, spec.alpha_uv),
            blinks: spec.blinks.then(|| Blinks::new(noise(3), &scalp, rate)),
            interference: Interference::new(noise(4), spec),
            rails: spec.rails.then(|| Rails::new(noise(5), electrodes, rate)),
            saturated: 0,
        })
    }

    /// The next sample. Never ends.
    pub fn next_sample(&mut self) -> [i32; CHANNELS] {
        let mut microvolts = [0.0; CHANNELS];
        let scalp = &mut microvolts[..self.electrodes];
        self.background.add(scalp);
        self.alpha.add(scalp);
        if let Some(blinks) = &mut self.blinks {
            blinks.add(scalp);
        }
        self.interference.add(scalp);
        if let Some(rails) = &mut self.rails {
            rails.add(scalp);
        }
        microvolts.map(|uv| {
            let steps = (uv / self.lsb_uv).round();
            self.saturated += u64::from(!RAILS.contains(&steps));
            #[expect(clippy::cast_possible_truncation, reason = "whole and within i24")]
            let count = steps.clamp(*RAILS.start(), *RAILS.end()) as i32;
            count
        })
    }

    /// Counts that were limited to a rail so far.
    pub fn saturated(&self) -> u64 {
        self.saturated
    }
}

impl Iterator for Generator {
    type Item = [i32; CHANNELS];

    fn next(&mut self) -> Option<Self::Item> {
        Some(self.next_sample())
    }
}
