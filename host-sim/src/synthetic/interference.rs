//! What an electrode adds to the EEG: mains, offset and drift, and episodes at the ADC's rail.

use super::{
    noise::{Noise, SmoothNoise},
    phasor::Phasor,
    spec::SyntheticSpec,
};

/// Corner frequency of the drift's low-pass, Hz. The low-pass is of second order: of a drift of 100
/// uV RMS, 0.5 uV are above 0.5 Hz. A low-pass of first order would leave 16 uV above 0.5 Hz,
/// within the band of the EEG.
const DRIFT_HZ: f64 = 0.02;

#[derive(Debug, Clone)]
pub(super) struct Interference {
    noise: Noise,
    mains: Phasor,
    drift_uv: f64,
    electrodes: Vec<ElectrodeInterference>,
}

#[derive(Debug, Clone)]
struct ElectrodeInterference {
    /// Amplitudes of the mains voltage's cosine and sine parts, uV.
    mains_uv: (f64, f64),
    offset_uv: f64,
    drift: SmoothNoise,
}

impl Interference {
    pub(super) fn new(mut noise: Noise, spec: &SyntheticSpec) -> Self {
        let rate = f64::from(spec.rate_hz);
        let mut electrode = || {
            let amplitude = spec.mains_uv * noise.uniform(0.5, 1.5);
            // Draw the tangent of half the phase and compute the phase's cosine and sine from it,
            // without trigonometric functions. The phase is within +-33 degrees.
            let tangent = noise.uniform(-0.3, 0.3);
            let scale = amplitude / (1.0 + tangent * tangent);
            ElectrodeInterference {
                mains_uv: (scale * (1.0 - tangent * tangent), scale * 2.0 * tangent),
                offset_uv: noise.uniform(-1000.0, 1000.0) * spec.offset_mv,
                drift: SmoothNoise::new(DRIFT_HZ, rate, &mut noise),
            }
        };
        let electrodes = spec.electrodes.iter().map(|_| electrode()).collect();
        let mains = Phasor::new(f64::from(spec.mains_hz), rate);
        Self { noise, mains, drift_uv: spec.drift_uv, electrodes }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        let (cos, sin) = self.mains.advance();
        for (uv, electrode) in microvolts.iter_mut().zip(&mut self.electrodes) {
            let drift = self.drift_uv * electrode.drift.advance(&mut self.noise);
            let (on_cos, on_sin) = electrode.mains_uv;
            *uv += electrode.offset_uv + drift + on_cos * cos + on_sin * sin;
        }
    }
}

/// Voltage that drives an electrode to the rail, uV: far beyond the ADC's +-187,500 uV, so the
/// count is clipped whatever the other components are.
const RAIL_UV: f64 = 1e6;

/// Episodes with one electrode at the ADC's rail, as if it had come loose.
#[derive(Debug, Clone)]
pub(super) struct Rails {
    noise: Noise,
    electrodes: usize,
    rate: f64,
    wait: u32,
    /// Index of the electrode, added voltage in uV and number of remaining samples of the current
    /// episode; `None` between episodes.
    now: Option<(usize, f64, u32)>,
}

impl Rails {
    pub(super) fn new(mut noise: Noise, electrodes: usize, rate: f64) -> Self {
        let wait = noise.samples(5.0, 20.0, rate);
        Self { noise, electrodes, rate, wait, now: None }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        let Some((electrode, added_uv, left)) = self.now else {
            self.wait -= 1;
            if self.wait == 0 && self.electrodes > 0 {
                let electrode = self.noise.index(self.electrodes);
                let added_uv = if self.noise.uniform(0.0, 1.0) < 0.5 { -RAIL_UV } else { RAIL_UV };
                self.now = Some((electrode, added_uv, self.noise.samples(0.2, 1.5, self.rate)));
            }
            if self.wait == 0 {
                self.wait = self.noise.samples(5.0, 20.0, self.rate);
            }
            return;
        };
        microvolts[electrode] += added_uv;
        self.now = (left > 1).then_some((electrode, added_uv, left - 1));
    }
}
