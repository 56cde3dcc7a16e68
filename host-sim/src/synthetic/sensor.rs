//! Noise of electrode, skin and amplifier, independent at each electrode.

use super::noise::Noise;

/// White noise of each electrode, uV RMS over half the sample rate; at 512 Hz, 0.5 of it are within
/// 0.5-60 Hz. An ADS1299 at gain 24 and 512 Hz contributes about 0.2 (`ads1299::typical_noise_uv`,
/// derived from the data sheet); the rest represents wet electrodes.
const NOISE_UV: f64 = 1.0;

#[derive(Debug, Clone)]
pub(super) struct Sensors {
    noise: Noise,
}

impl Sensors {
    pub(super) fn new(noise: Noise) -> Self {
        Self { noise }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        for uv in microvolts {
            *uv += NOISE_UV * self.noise.normal();
        }
    }
}
