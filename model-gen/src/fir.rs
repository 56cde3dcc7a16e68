//! Design of low-pass FIR filters: the windowed sinc.

use std::f64::consts::PI;

/// Returns the taps of a symmetric low-pass: a sinc times a Kaiser window of shape `beta`, -6 dB at
/// `cutoff_hz`, gain exactly 1 at DC.
///
/// Equals `scipy.signal.firwin(taps, cutoff_hz, window=('kaiser', beta), fs=rate_hz)`.
/// Expects `taps > 1` and `0 < cutoff_hz < rate_hz / 2`.
pub fn kaiser_low_pass(taps: usize, cutoff_hz: f64, beta: f64, rate_hz: f64) -> Vec<f64> {
    let centre = real(taps - 1) / 2.0;
    let width = 2.0 * cutoff_hz / rate_hz;
    let mut response: Vec<f64> = (0..taps)
        .map(|n| {
            let from_centre = real(n) - centre;
            let rise = 1.0 - (from_centre / centre).powi(2);
            sinc(width * from_centre) * bessel_i0(beta * rise.max(0.0).sqrt())
        })
        .collect();
    let at_dc: f64 = response.iter().sum();
    for tap in &mut response {
        *tap /= at_dc;
    }
    response
}

/// Returns `sin(pi x) / (pi x)`.
fn sinc(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}

/// Returns the modified Bessel function of the first kind, order 0: the sum of `((x / 2)^k / k!)^2`
/// (Abramowitz and Stegun 9.6.12). All terms are positive, and the series converges quickly.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > f64::EPSILON * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

#[expect(clippy::cast_precision_loss, reason = "a filter has thousands of taps")]
fn real(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bessel_function_equals_scipy_s() {
        // scipy 1.17: scipy.special.i0([0, 1, 5, 12]).
        for (x, expected) in [
            (0.0, 1.0),
            (1.0, 1.266_065_877_752_008_2),
            (5.0, 27.239_871_823_604_442),
            (12.0, 18_948.925_349_296_31),
        ] {
            let error = bessel_i0(x) / expected - 1.0;
            assert!(error.abs() < 1e-14, "I0({x}) is off by {error:e}");
        }
    }

    #[test]
    fn the_response_is_symmetric_and_passes_a_constant() {
        let taps = kaiser_low_pass(64, 62.0, 5.0, 512.0);
        let mirrored: Vec<f64> = taps.iter().rev().copied().collect();
        assert_eq!(taps, mirrored);
        assert!((taps.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }
}
