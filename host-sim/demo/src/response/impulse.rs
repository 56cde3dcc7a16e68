//! Magnitude and group delay of a filter, computed from its response to an impulse.

use std::f64::consts::PI;

use fixed_dsp::{CascadeState, Filter};
use num_complex::Complex64;
use pipeline::Mains;

use super::twin::Twin;

/// Height of the impulse, Q27.5: twice the ADC's full scale, so that rounding is small relative to the
/// response. No node wraps: all have headroom for 8 times full scale, and even for the worst input of full
/// scale the largest node reaches only 6.8 times (signal/model/manifest.txt). A single impulse, even of twice full
/// scale, excites a node far less.
const IMPULSE: i32 = 1 << 29;
/// Length of the recorded response, s. The slowest poles decay at 0.96 / s, so after 10 s they have decayed
/// by about e^-10. Later values are mostly rounding errors, and the group delay weights each value by its
/// time.
const SECONDS: usize = 10;

/// Response of a filter to a unit impulse, at the ADC's rate.
#[derive(Debug)]
pub(super) struct ImpulseResponse(Vec<f64>);

impl ImpulseResponse {
    /// Measures the response of the fixed-point filters: half the difference between the responses to an
    /// impulse and to its negative. In this difference, the initial value of the carried rounding error
    /// cancels.
    pub(super) fn from_filters() -> Self {
        let mut states = [CascadeState::REST; 2];
        let response = (0..samples()).map(|n| {
            let x = if n == 0 { IMPULSE } else { 0 };
            let up = f64::from(Mains::Hz50.apply(&mut states[0], x));
            let down = f64::from(Mains::Hz50.apply(&mut states[1], -x));
            (up - down) / 2.0 / f64::from(IMPULSE)
        });
        Self(response.collect())
    }

    /// Computes the response of the float64 twin.
    pub(super) fn from_twin(twin: &Twin) -> Self {
        let mut twin = twin.clone();
        let response = (0..samples()).map(|n| twin.apply(if n == 0 { 1.0 } else { 0.0 }));
        Self(response.collect())
    }

    /// Returns the magnitude at a frequency, dB.
    pub(super) fn magnitude_db(&self, hz: f64) -> f64 {
        10.0 * self.sums(hz)[0].norm_sqr().log10()
    }

    /// Returns the group delay at a frequency, ms: the real part of `sum n h[n] z^n / sum h[n] z^n`.
    pub(super) fn group_delay_ms(&self, hz: f64) -> f64 {
        let [sum, moment] = self.sums(hz);
        (moment / sum).re / f64::from(model::ADC_RATE_HZ) * 1000.0
    }

    /// Returns `sum h[n] z^n` and `sum n h[n] z^n`, by Horner's rule.
    fn sums(&self, hz: f64) -> [Complex64; 2] {
        let z = Complex64::from_polar(1.0, -2.0 * PI * hz / f64::from(model::ADC_RATE_HZ));
        let [mut sum, mut moment] = [Complex64::ZERO; 2];
        let length = u32::try_from(self.0.len()).unwrap_or(u32::MAX);
        for (n, h) in (0..length).zip(&self.0).rev() {
            sum = sum * z + h;
            moment = moment * z + f64::from(n) * h;
        }
        [sum, moment]
    }
}

fn samples() -> usize {
    SECONDS * usize::from(model::ADC_RATE_HZ)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impulse_three_samples_late_has_a_delay_of_three_samples_and_gain_1() {
        let late = ImpulseResponse(vec![0.0, 0.0, 0.0, 1.0]);
        let three_ms = 3000.0 / f64::from(model::ADC_RATE_HZ);
        for hz in [1.0, 40.0] {
            assert!(late.magnitude_db(hz).abs() < 1e-12);
            assert!((late.group_delay_ms(hz) - three_ms).abs() < 1e-9);
        }
    }
}
