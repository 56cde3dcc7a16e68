//! Blinks: large frontal deflections of 0.3 s, from a dipole in each eye.

use super::{dipole::Dipole, noise::Noise, scalp::Scalp};

/// Electrode at which blinks have their largest amplitude.
const SITE: &str = "Fpz";
/// Positions of the eyes, in radii of the scalp: as far from the midline and as high as in a real
/// head, but moved back until they lie in the brain of the spherical head.
const EYES: [[f64; 3]; 2] = [[-0.33, 0.7, -0.3], [0.33, 0.7, -0.3]];
/// Dipole moment of each eye while the lid slides over the cornea: forward and up.
const MOMENT: [f64; 3] = [0.0, 0.8, 0.6];
/// Time from the start of a blink to its peak, s.
const RISE_S: f64 = 0.1;
/// Time from the peak of a blink to its end, s.
const FALL_S: f64 = 0.2;

#[derive(Debug, Clone)]
pub(super) struct Blinks {
    noise: Noise,
    rate: f64,
    /// Potential of a blink at each electrode, relative to the potential at [`SITE`].
    weights: Vec<f64>,
    /// Number of samples until the next blink; decreases between blinks.
    wait: u32,
    /// Time since the start of the current blink, s, and its peak amplitude at [`SITE`], uV; `None`
    /// between blinks.
    now: Option<(f64, f64)>,
}

impl Blinks {
    pub(super) fn new(mut noise: Noise, scalp: &Scalp, rate: f64) -> Self {
        let eyes = EYES.map(|place| Dipole::at(place, MOMENT));
        let peak: f64 = eyes.iter().map(|eye| scalp.potential_at(eye, SITE)).sum();
        let [left, right] = eyes.map(|eye| scalp.potentials(&eye, 1.0 / peak));
        let weights = left.iter().zip(right).map(|(a, b)| a + b).collect();
        let wait = noise.samples(2.0, 7.0, rate);
        Self { noise, rate, weights, wait, now: None }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        let Some((time, height)) = self.now else {
            self.wait -= 1;
            if self.wait == 0 {
                self.now = Some((0.0, self.noise.uniform(150.0, 300.0)));
                self.wait = self.noise.samples(2.0, 7.0, self.rate);
            }
            return;
        };
        let shape = smoothstep(time / RISE_S) * smoothstep((RISE_S + FALL_S - time) / FALL_S);
        for (uv, weight) in microvolts.iter_mut().zip(&self.weights) {
            *uv += weight * height * shape;
        }
        let time = time + 1.0 / self.rate;
        self.now = (time < RISE_S + FALL_S).then_some((time, height));
    }
}

/// Returns 0 for `x` below 0, 1 for `x` above 1 and `x^2 (3 - 2x)` between.
fn smoothstep(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
