//! Low-pass filter whose output can be at any position between two input samples.

use std::f64::consts::PI;

use crate::ratio::{Ratio, quotient};

/// Design attenuation, dB. Kaiser's formula is only accurate to a few dB; the tests require 90 dB.
const ATTENUATION_DB: f64 = 93.0;
/// Upper edge of the pass band, Hz: the upper edge of the EEG band that a device encodes.
const PASS_HZ: f64 = 60.0;
/// Largest upper edge of the pass band, as a fraction of half the lower of the two rates.
const PASS_SHARE: f64 = 0.9;
/// Frequency up to which the images of the input are in the stop band, Hz. The image of a frequency
/// f is at the input's rate minus f. Images of higher frequencies can be below the stop band, but
/// only above half the input's rate, where a device's band-pass attenuates them more than the
/// originals.
const IMAGES_HZ: f64 = 90.0;
/// Number of partial sums into which the products of taps and input are added, so that the compiler
/// can use vector instructions. The number of taps is a multiple of this number.
const LANES: usize = 4;
/// Largest number of taps, over all phases, that are precomputed and stored: 8 MiB.
const KEPT_TAPS: u64 = 1 << 20;

/// A sinc under a Kaiser window. The tap for an input sample d samples after the output's position
/// is
///
/// ```text
/// h(d) = g sin(pi c d) / (pi d) I0(b sqrt(1 - (2 d / T)^2))   for |d| < T / 2, otherwise 0
/// b = 0.1102 (A - 8.7)
/// T = 1 + (A - 7.95) / (7.18 (s - p))
/// c = (s + p) / 2
/// ```
///
/// where I0 is the modified Bessel function, A the attenuation in dB, T the number of taps, p the
/// end of the pass band and s the start of the stop band. c, p and s are frequencies divided by
/// half the input rate. If the output rate is the lower one, the stop band starts at half the
/// output rate. Otherwise it starts at half the output rate or at the image of [`IMAGES_HZ`],
/// whichever is lower, but not below half the input rate. g makes the taps of each position sum to
/// 1, so that a constant passes unchanged. T follows from [`ATTENUATION_DB`], rounded up to a
/// multiple of [`LANES`], and A from this T.
///
/// Source: J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function",
/// IEEE Int. Symp. Circuits and Systems, 1974; b and T as in `scipy.signal.kaiserord`.
pub(super) struct LowPass {
    /// Number of taps T.
    taps: usize,
    /// Cut-off c, at which the amplitude is halved, divided by half the input rate.
    cutoff: f64,
    /// Shape b of the window.
    beta: f64,
    /// Number of different positions that an output can have between two input samples.
    phases: u64,
    /// Whether `table` holds the taps of all phases, or only the taps of the newest phase.
    is_kept: bool,
    /// Taps, `[phase][tap]`.
    table: Vec<f64>,
}

impl LowPass {
    /// Designs the low-pass for an input at `rate_hz` and for outputs that are `step` input samples
    /// apart.
    pub(super) fn new(rate_hz: f64, step: Ratio) -> Self {
        let half_rate = rate_hz / 2.0;
        let half_output = 1.0 / step.value();
        let pass = (PASS_HZ / half_rate).min(PASS_SHARE * half_output.min(1.0));
        let image = (rate_hz - IMAGES_HZ) / half_rate;
        let stop = image.max(1.0).min(half_output);
        let slope_db = 7.18 * (stop - pass);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive; a step of at most 1,000 samples takes some 100,000 taps"
        )]
        let least = (1.0 + (ATTENUATION_DB - 7.95) / slope_db).ceil() as usize;
        let taps = least.next_multiple_of(LANES);
        let attenuation_db = 7.95 + slope_db * (quotient(taps as u64, 1) - 1.0);
        let mut low_pass = Self {
            taps,
            cutoff: f64::midpoint(stop, pass),
            beta: 0.1102 * (attenuation_db - 8.7),
            phases: step.denominator(),
            is_kept: step.denominator().saturating_mul(taps as u64) <= KEPT_TAPS,
            table: Vec::new(),
        };
        if low_pass.is_kept {
            let phases = (0..low_pass.phases).flat_map(|phase| low_pass.design(phase));
            low_pass.table = phases.collect();
        }
        low_pass
    }

    /// Returns the number of taps, a multiple of 4.
    pub(super) fn taps(&self) -> usize {
        self.taps
    }

    /// Returns the taps for an output that lies `phase` / (denominator of the step) of a sample
    /// after an input sample. The first tap belongs to the input T / 2 - 1 samples before this
    /// input sample.
    pub(super) fn phase(&mut self, phase: u64) -> &[f64] {
        if !self.is_kept {
            self.table = self.design(phase);
            return &self.table;
        }
        let at = usize::try_from(phase).unwrap_or(0) * self.taps;
        &self.table[at..at + self.taps]
    }

    fn design(&self, phase: u64) -> Vec<f64> {
        let half = self.taps / 2;
        let offset = quotient(phase, self.phases) + quotient(half as u64 - 1, 1);
        let taps = (0..self.taps as u64).map(|tap| {
            let distance = quotient(tap, 1) - offset;
            let edge = distance / quotient(half as u64, 1);
            let rise = 1.0 - edge * edge;
            if rise <= 0.0 {
                return 0.0;
            }
            // `libm` yields the same sine on every platform; the standard library does not.
            let sinc = if distance == 0.0 {
                self.cutoff
            } else {
                libm::sin(PI * self.cutoff * distance) / (PI * distance)
            };
            sinc * bessel_i0(self.beta * rise.sqrt())
        });
        let mut taps: Vec<f64> = taps.collect();
        let sum: f64 = taps.iter().sum();
        for tap in &mut taps {
            *tap /= sum;
        }
        taps
    }
}

/// Returns the sum of the products of taps and input, whose lengths are equal. The additions have a
/// fixed order, so the sum is the same on every machine.
pub(super) fn weighted_sum(taps: &[f64], input: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (taps, _) = taps.as_chunks::<LANES>();
    let (input, _) = input.as_chunks::<LANES>();
    for (taps, input) in taps.iter().zip(input) {
        for ((sum, tap), value) in sums.iter_mut().zip(taps).zip(input) {
            *sum += tap * value;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Returns the modified Bessel function of the first kind and order 0, by its power series, for x
/// from 0 to a few tens.
fn bessel_i0(x: f64) -> f64 {
    let square = x * x / 4.0;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > sum * f64::EPSILON / 4.0 {
        term *= square / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_are_those_of_scipy() {
        // scipy 1.17, for 256 Hz at 512 Hz, halfway between two samples: d = arange(-7, 9) - 0.5;
        // h = sinc((166 + 60) / 256 * d) * special.i0(beta * sqrt(1 - (d / 8)**2)); h / h.sum()
        // with beta = 0.1102 * (7.95 + 7.18 * (166 - 60) / 128 * 15 - 8.7).
        let mut low_pass = LowPass::new(256.0, Ratio::new(1, 2).expect("positive"));
        let taps = low_pass.phase(1);
        assert_eq!(taps.len(), 16);
        for (tap, expected) in [
            (0, 0.000_119_950_291_652_996_01),
            (3, -0.001_237_788_152_453_259),
            (6, -0.153_393_661_202_406_05),
            (7, 0.614_679_407_277_457_4),
        ] {
            for tap in [taps[tap], taps[15 - tap]] {
                assert!((tap - expected).abs() < 1e-15, "{tap}, not {expected}");
            }
        }
    }
}
