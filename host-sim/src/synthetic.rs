//! Synthetic EEG: seeded, endless, in ADC counts.
//!
//! Each sample is the sum of several components: a 1/f^1.7 background from dipoles in the cortex
//! (`background`), alpha bursts from the occipital cortex (`alpha`), on request the sensorimotor
//! rhythm of both hand areas (`mu`), and blinks (`blink`); white noise of the sensors; mains, an
//! electrode offset and its slow drift; and, on request, episodes at the ADC's rail
//! (`interference`). Each component has a separate random stream, so switching blinks or rails off
//! does not change the others. The dipoles are drawn from the seed, and the potentials at an
//! electrode do not depend on the other electrodes.
//!
//! A dipole's potential is computed on a sphere of brain, skull and scalp (`head`), against the
//! mean of both ear lobes. The table compares it with a recording of the same 61 electrodes
//! (`files/montages/ten-ten-61.toml`) against the same reference, both within 0.5-60 Hz, with alpha
//! and blinks, seeds 1, 2, 3 and 7 over 120 s:
//!
//! | | Generator | EEGMMIDB S001 |
//! | --- | --- | --- |
//! | variance in 1 principal component in space | 64-66 % | 56-70 % (R01, R02, R03, R07, R11) |
//! | in 10 | 99.3-99.4 % | 97.4-98.1 % |
//! | in 20 | 99.9 % | 99.2-99.4 % |
//! | in 30 | 99.98 % | 99.7-99.8 % |
//! | correlation at a distance of 0.3 radii | 0.96 | 0.92-0.94 |
//! | at 0.7 | 0.84 | 0.79-0.85 |
//! | at 1.1 | 0.62-0.64 | 0.57-0.71 |
//! | at 1.7 | 0.33-0.39 | 0.26-0.50 |
//!
//! A recording also holds muscle activity and differences between electrodes, which the dipoles
//! lack.
//!
//! Equal specs yield equal counts on every platform. The random numbers come from ChaCha8, and
//! samples are computed with `+ - * /` and square roots, for which IEEE 754 specifies every bit of
//! the result. Only the electrodes' positions depend on the platform's sine function; potentials
//! at the positions are rounded to 2^-20 (see `scalp`).

mod alpha;
mod background;
mod blink;
mod dipole;
mod head;
mod interference;
mod mu;
mod noise;
mod phasor;
mod scalp;
mod spec;
#[cfg(test)]
mod tests;

use recordings::virtual_adc::CHANNELS;

use self::alpha::Alpha;
use self::background::Background;
use self::blink::Blinks;
use self::interference::{Interference, Rails};
use self::mu::Mu;
pub(crate) use self::noise::Noise;
use self::scalp::Scalp;

pub use mu::Hand;
pub use spec::{SyntheticError, SyntheticSpec};

/// Range of a 24-bit ADC, counts.
const RAILS: std::ops::RangeInclusive<f64> = -8_388_608.0..=8_388_607.0;

/// White noise of electrode, skin and amplifier, independent at each electrode, uV RMS up to half
/// the sample rate; at 512 Hz, 0.5 uV of it lie within 0.5-60 Hz. An ADS1299 at gain 24 and 512 Hz
/// contributes about 0.2 uV (`ads1299::typical_noise_uv`, from the data sheet); the rest represents
/// wet electrodes.
const SENSOR_UV: f64 = 1.0;

/// Generator of synthetic EEG: an endless iterator over samples of 64 counts, each a 24-bit value
/// in an `i32`.
#[derive(Debug, Clone)]
pub struct Generator {
    lsb_uv: f64,
    electrodes: usize,
    background: Background,
    sensors: Option<Noise>,
    alpha: Alpha,
    mu: Option<Mu>,
    moving: Option<Hand>,
    blinks: Option<Blinks>,
    interference: Interference,
    rails: Option<Rails>,
}

impl Generator {
    /// Creates a generator. Its samples depend only on `spec` and on calls of [`Self::move_hand`].
    ///
    /// # Errors
    /// [`SyntheticError`] if a field of `spec` is outside its range.
    pub fn new(spec: &SyntheticSpec) -> Result<Self, SyntheticError> {
        let SyntheticSpec { rate_hz, lsb_uv, mains_hz, .. } = *spec;
        if !(128..=16_000).contains(&rate_hz) || mains_hz == 0 || mains_hz >= rate_hz / 2 {
            return Err(SyntheticError::Rate { rate_hz, mains_hz });
        }
        if !lsb_uv.is_finite() || lsb_uv <= 0.0 {
            return Err(SyntheticError::Scale(lsb_uv));
        }
        for (name, value) in [
            ("background_uv", spec.background_uv),
            ("alpha_uv", spec.alpha_uv),
            ("mu_uv", spec.mu_uv),
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
            return Err(SyntheticError::TooManyElectrodes(electrodes));
        }
        let scalp = Scalp::new(&spec.electrodes)?;
        let rate = f64::from(rate_hz);
        let noise = |stream| Noise::new(spec.seed, stream);
        Ok(Self {
            lsb_uv,
            electrodes,
            background: Background::new(noise(1), &scalp, rate, spec.background_uv),
            alpha: Alpha::new(noise(2), &scalp, rate, spec.alpha_uv),
            mu: (spec.mu_uv > 0.0).then(|| Mu::new(noise(7), &scalp, rate, spec.mu_uv)),
            moving: None,
            blinks: spec.blinks.then(|| Blinks::new(noise(3), &scalp, rate)),
            interference: Interference::new(noise(4), spec),
            sensors: (spec.background_uv > 0.0).then(|| noise(6)),
            rails: spec.rails.then(|| Rails::new(noise(5), electrodes, rate)),
        })
    }

    /// Returns the next sample; channels without an electrode are 0.
    pub fn next_sample(&mut self) -> [i32; CHANNELS] {
        let mut microvolts = [0.0; CHANNELS];
        let scalp = &mut microvolts[..self.electrodes];
        self.background.add(scalp);
        self.alpha.add(scalp);
        if let Some(mu) = &mut self.mu {
            mu.add(self.moving, scalp);
        }
        if let Some(sensors) = &mut self.sensors {
            for uv in &mut *scalp {
                *uv += SENSOR_UV * sensors.normal();
            }
        }
        if let Some(blinks) = &mut self.blinks {
            blinks.add(scalp);
        }
        self.interference.add(scalp);
        if let Some(rails) = &mut self.rails {
            rails.add(scalp);
        }
        microvolts.map(|uv| {
            let counts = (uv / self.lsb_uv).round();
            #[expect(clippy::cast_possible_truncation, reason = "whole and within i24")]
            let count = counts.clamp(*RAILS.start(), *RAILS.end()) as i32;
            count
        })
    }

    /// Sets which hand moves from the next sample on, in EEG with a sensorimotor rhythm; `None` is
    /// rest.
    pub fn move_hand(&mut self, hand: Option<Hand>) {
        self.moving = hand;
    }
}

impl Iterator for Generator {
    type Item = [i32; CHANNELS];

    fn next(&mut self) -> Option<Self::Item> {
        Some(self.next_sample())
    }
}
