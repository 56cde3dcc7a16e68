//! Alpha rhythm: bursts of 10 Hz over the back of the head.

use recordings::Position;

use super::{
    noise::{Noise, pole},
    phasor::Phasor,
    scalp::Scalp,
};

/// Centre frequency of the rhythm, Hz.
const ALPHA_HZ: f64 = 10.0;
/// Half of the rhythm's bandwidth, Hz. This bandwidth makes the amplitude vary within about a
/// second, even during a burst.
const HALF_WIDTH: f64 = 0.5;
/// Electrodes under which the sources of the rhythm are placed.
const SITES: [&str; 3] = ["PO3", "POz", "PO4"];
/// Reach of a source (see `Scalp::weights`), in radii of the head.
const REACH: f64 = 0.7;
/// Amplitude between bursts, relative to the amplitude in a burst.
const REST: f64 = 0.15;
/// Corner frequency of the envelope's low-pass, Hz.
const ENVELOPE: f64 = 0.6;

#[derive(Debug, Clone)]
pub(super) struct Alpha {
    noise: Noise,
    rate: f64,
    damping: f64,
    drive: f64,
    phasors: Vec<Phasor>,
    /// Amplitude of each source at each electrode, uV RMS: `mixing[electrode][source]`.
    mixing: Vec<Vec<f64>>,
    in_burst: bool,
    samples_left: u32,
    envelope: f64,
    envelope_pole: f64,
}

impl Alpha {
    pub(super) fn new(noise: Noise, scalp: &Scalp, rate: f64, rms_uv: f64) -> Self {
        let sites = SITES.iter().filter_map(|label| Position::from_label(label));
        let seen: Vec<Vec<f64>> = sites.map(|site| scalp.weights(site, REACH)).collect();
        // The powers of independent sources add. An electrode near all three receives three times
        // the power of one source, so each source is scaled by 1 / sqrt(3).
        let scale = rms_uv / f64::from(3_u8).sqrt();
        let mixing = (0..scalp.electrodes())
            .map(|electrode| seen.iter().map(|row| row[electrode] * scale).collect())
            .collect();
        let damping = pole(HALF_WIDTH, rate);
        Self {
            noise,
            rate,
            damping,
            drive: (1.0 - damping * damping).sqrt(),
            phasors: vec![Phasor::new(ALPHA_HZ, rate); SITES.len()],
            mixing,
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
        for phasor in &mut self.phasors {
            phasor.rotate(self.damping);
            phasor.point.0 += self.drive * self.noise.normal();
            phasor.point.1 += self.drive * self.noise.normal();
        }
        for (uv, row) in microvolts.iter_mut().zip(&self.mixing) {
            let mixed: f64 = row
                .iter()
                .zip(&self.phasors)
                .map(|(w, phasor)| w * phasor.point.0)
                .sum();
            *uv += mixed * self.envelope;
        }
    }
}
