//! Alpha rhythm: bursts of 10 Hz from the occipital cortex.

use super::{
    dipole::Dipole,
    noise::{Noise, pole},
    phasor::Phasor,
    scalp::Scalp,
};

/// Centre frequency of the rhythm, Hz.
const ALPHA_HZ: f64 = 10.0;
/// Half of the rhythm's bandwidth, Hz. This bandwidth makes the amplitude vary within about a
/// second, even during a burst.
const HALF_WIDTH: f64 = 0.5;
/// Position, in radii of the scalp, and moment of each of the rhythm's dipoles in the occipital
/// cortex: left, right and upper.
const DIPOLES: [([f64; 3], [f64; 3]); 3] = [
    ([-0.2, -0.6, 0.15], [-0.2, -1.0, 0.3]),
    ([0.2, -0.6, 0.15], [0.2, -1.0, 0.3]),
    ([0.0, -0.55, 0.35], [0.0, -1.0, 0.6]),
];
/// Electrodes over the back of the head. `SyntheticSpec::alpha_uv` is the largest of the rhythm's
/// amplitudes at these electrodes.
const SITES: &str = "Pz PO3 POz PO4 O1 Oz O2";
/// Amplitude between bursts, relative to the amplitude in a burst.
const REST: f64 = 0.15;
/// Corner frequency of the low-pass that smooths the start and end of a burst, Hz.
const ENVELOPE: f64 = 0.6;

#[derive(Debug, Clone)]
pub(super) struct Alpha {
    noise: Noise,
    rate: f64,
    damping: f64,
    phasors: Vec<Phasor>,
    /// Amplitude of each dipole at each electrode in a burst, uV RMS.
    amplitudes: Vec<Vec<f64>>,
    in_burst: bool,
    samples_left: u32,
    envelope: f64,
    envelope_pole: f64,
}

impl Alpha {
    pub(super) fn new(noise: Noise, scalp: &Scalp, rate: f64, rms_uv: f64) -> Self {
        let dipoles = DIPOLES.map(|(place, moment)| Dipole::at(place, moment));
        let powers = scalp.powers_at(&dipoles, SITES);
        let scale = rms_uv / powers.into_iter().fold(0.0, f64::max).sqrt();
        let amplitudes = dipoles.iter().map(|dipole| scalp.potentials(dipole, scale));
        Self {
            noise,
            rate,
            damping: pole(HALF_WIDTH, rate),
            phasors: vec![Phasor::new(ALPHA_HZ, rate); DIPOLES.len()],
            amplitudes: amplitudes.collect(),
            in_burst: false,
            samples_left: 1,
            envelope: REST,
            envelope_pole: pole(ENVELOPE, rate),
        }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        self.samples_left -= 1;
        if self.samples_left == 0 {
            self.in_burst = !self.in_burst;
            self.samples_left = self.noise.samples(1.0, 4.0, self.rate);
        }
        let target = if self.in_burst { 1.0 } else { REST };
        self.envelope = target + self.envelope_pole * (self.envelope - target);
        for (phasor, amplitudes) in self.phasors.iter_mut().zip(&self.amplitudes) {
            let activity = phasor.resonate(self.damping, &mut self.noise) * self.envelope;
            for (uv, amplitude) in microvolts.iter_mut().zip(amplitudes) {
                *uv += amplitude * activity;
            }
        }
    }
}
