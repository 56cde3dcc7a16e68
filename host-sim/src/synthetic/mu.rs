//! Sensorimotor rhythm: 11 Hz, and its harmonic at 22 Hz, from the hand area of either hemisphere.
//! It weakens in the hemisphere opposite a hand that moves or is imagined to move (Pfurtscheller
//! and Lopes da Silva 1999).

use super::dipole::Dipole;
use super::noise::{Noise, pole};
use super::phasor::Phasor;
use super::scalp::Scalp;

/// Centre frequency of each of the rhythm's two components, Hz, and the component's share of the
/// amplitude.
const RHYTHMS: [(f64, f64); 2] = [(11.0, 0.9), (22.0, 0.43)];
/// Half of the bandwidth of either frequency, Hz.
const HALF_WIDTH: f64 = 1.0;
/// Position of the left hand area, in radii of the scalp, below C3; the right hand area mirrors it.
/// The dipole is radial.
const HAND_AREA: [f64; 3] = [-0.52, 0.0, 0.5];
/// Electrode at which the left hand area has the amplitude `SyntheticSpec::mu_uv` at rest.
const SITE: &str = "C3";
/// Amplitude in the hemisphere opposite a moving hand, relative to the amplitude at rest.
const MOVING: f64 = 0.5;
/// Corner frequency of the low-pass that smooths the start and end of a movement, Hz.
const ENVELOPE: f64 = 0.6;

/// A hand that moves, or is imagined to move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hand {
    /// The left hand. Its movement weakens the rhythm of the right hemisphere.
    Left,
    /// The right hand. Its movement weakens the rhythm of the left hemisphere.
    Right,
}

#[derive(Debug, Clone)]
pub(super) struct Mu {
    noise: Noise,
    damping: f64,
    envelope_pole: f64,
    areas: [HandArea; 2],
}

#[derive(Debug, Clone)]
struct HandArea {
    /// Hand on the other side of the body, whose movement weakens this rhythm.
    hand: Hand,
    phasors: [Phasor; 2],
    /// Amplitude at each electrode at rest, uV RMS.
    amplitudes: Vec<f64>,
    envelope: f64,
}

impl Mu {
    pub(super) fn new(noise: Noise, scalp: &Scalp, rate: f64, rms_uv: f64) -> Self {
        let [x, y, z] = HAND_AREA;
        let scale = rms_uv / scalp.potential_at(&Dipole::at(HAND_AREA, HAND_AREA), SITE).abs();
        let areas = [(Hand::Right, x), (Hand::Left, -x)].map(|(hand, x)| HandArea {
            hand,
            phasors: RHYTHMS.map(|(hz, _)| Phasor::new(hz, rate)),
            amplitudes: scalp.potentials(&Dipole::at([x, y, z], [x, y, z]), scale),
            envelope: 1.0,
        });
        Self { noise, damping: pole(HALF_WIDTH, rate), envelope_pole: pole(ENVELOPE, rate), areas }
    }

    /// Adds the rhythm of both hemispheres while `moving` moves; `None` is rest.
    pub(super) fn add(&mut self, moving: Option<Hand>, microvolts: &mut [f64]) {
        for area in &mut self.areas {
            let target = if moving == Some(area.hand) { MOVING } else { 1.0 };
            area.envelope = target + self.envelope_pole * (area.envelope - target);
            let mut activity = 0.0;
            for (phasor, (_, share)) in area.phasors.iter_mut().zip(RHYTHMS) {
                activity += share * area.envelope * phasor.resonate(self.damping, &mut self.noise);
            }
            for (uv, amplitude) in microvolts.iter_mut().zip(&area.amplitudes) {
                *uv += amplitude * activity;
            }
        }
    }
}
