//! Magnitude and group delay of a filter, from its response to an impulse.

use std::f64::consts::PI;

use fixed_dsp::{CascadeState, Filter};
use num_complex::Complex64;
use pipeline::Mains;

use super::spectrum::real;
use super::twin::Twin;

/// The impulse, Q27.5: twice the ADC's full scale, so that rounding is small beside it. A node whose
/// worst case is 6.8 times full scale (model/manifest.txt) sees a single impulse as far less, and
/// has room for 8.
const IMPULSE: i32 = 1 << 29;
/// Length of the response, s: the slowest poles, 0.97 / s, have decayed by e^-10. What comes
/// later is rounding, which the group delay weighs by its age.
const SECONDS: usize = 10;

/// Response of a filter to an impulse of 1, at the ADC's rate.
#[derive(Debug)]
pub(crate) struct ImpulseResponse(Vec<f64>);

impl ImpulseResponse {
    /// Of the fixed-point filters: half the difference of the responses to an impulse and its
    /// negative, where the start of the carried error cancels.
    pub(crate) fn of_the_filters() -> Self {
        let mut states = [CascadeState::REST; 2];
        let response = (0..samples()).map(|n| {
            let x = if n == 0 { IMPULSE } else { 0 };
            let up = f64::from(Mains::Hz50.apply(&mut states[0], x));
            let down = f64::from(Mains::Hz50.apply(&mut states[1], -x));
            (up - down) / 2.0 / f64::from(IMPULSE)
        });
        Self(response.collect())
    }

    /// Of the float64 twin.
    pub(crate) fn of_the_twin(twin: &Twin) -> Self {
        let mut twin = twin.clone();
        let response = (0..samples()).map(|n| twin.step(if n == 0 { 1.0 } else { 0.0 }));
        Self(response.collect())
    }

    /// Magnitude at a frequency, dB.
    pub(crate) fn magnitude_db(&self, hz: f64) -> f64 {
        10.0 * self.sums(hz)[0].norm_sqr().log10()
    }

    /// Group delay at a frequency, ms: the real part of `sum n h[n] z^n / sum h[n] z^n`.
    pub(crate) fn group_delay_ms(&self, hz: f64) -> f64 {
        let [sum, moment] = self.sums(hz);
        (moment / sum).re / f64::from(model::ADC_RATE_HZ) * 1000.0
    }

    /// `sum h[n] z^n` and `sum n h[n] z^n`, by Horner's rule.
    fn sums(&self, hz: f64) -> [Complex64; 2] {
        let z = Complex64::from_polar(1.0, -2.0 * PI * hz / f64::from(model::ADC_RATE_HZ));
        let zero = [Complex64::ZERO; 2];
        let backwards = self.0.iter().enumerate().rev();
        backwards.fold(zero, |[sum, moment], (n, h)| {
            [sum * z + h, moment * z + real(n) * h]
        })
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
