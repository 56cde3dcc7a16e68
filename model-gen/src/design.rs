//! Design of the band-pass and the notch, in zeros, poles and gain.

use std::f64::consts::PI;

use num_complex::Complex64;

/// A digital Butterworth band-pass: poles and gain; its zeros are at z = 1 and z = -1.
///
/// The transfer function is `gain * ((z - 1)(z + 1))^order / prod(z - pole)`.
#[derive(Clone, Debug)]
pub struct BandPass {
    /// `2 * order` poles inside the unit circle, closed under conjugation.
    pub poles: Vec<Complex64>,
    /// Constant factor of the transfer function.
    pub gain: f64,
    /// Order of the low-pass prototype; the band-pass has twice as many poles.
    pub order: usize,
}

/// Designs a Butterworth band-pass of `order` (per edge) between `low_hz` and `high_hz` at
/// `rate_hz`.
///
/// The analogue low-pass prototype becomes a band-pass, and the bilinear transform with both edges
/// pre-warped makes it digital. The result is the transfer function of scipy's
/// `butter(order, [low, high], 'bandpass', fs=rate)`. Expects `0 < low_hz < high_hz < rate_hz / 2`.
pub fn butterworth_band_pass(order: usize, low_hz: f64, high_hz: f64, rate_hz: f64) -> BandPass {
    let prewarp = |hz: f64| 2.0 * rate_hz * (PI * hz / rate_hz).tan();
    let (low, high) = (prewarp(low_hz), prewarp(high_hz));
    let (width, centre_squared) = (high - low, low * high);
    let bilinear = |s: Complex64| (2.0 * rate_hz + s) / (2.0 * rate_hz - s);

    let mut poles = Vec::with_capacity(2 * order);
    // The analogue gain is width^order; each analogue zero at 0 adds a factor (2 fs - 0).
    let mut gain = Complex64::new((2.0 * rate_hz * width).powi(as_power(order)), 0.0);
    for k in 0..order {
        let angle = PI * real(2 * k + order + 1) / (2.0 * real(order));
        let half = Complex64::from_polar(width / 2.0, angle);
        let spread = (half * half - centre_squared).sqrt();
        for pole in [half + spread, half - spread] {
            poles.push(bilinear(pole));
            gain /= 2.0 * rate_hz - pole;
        }
    }
    BandPass {
        poles,
        gain: gain.re,
        order,
    }
}

/// A second-order notch: numerator `gain [1, cosine, 1]`, denominator
/// `[1, gain cosine, 2 gain - 1]`.
#[derive(Clone, Copy, Debug)]
pub struct Notch {
    /// Factor of the numerator, `1 / (1 + tan(w0 / 2Q))`.
    pub gain: f64,
    /// Middle coefficient of the numerator without the factor `gain`: `-2 cos(w0)`.
    pub cosine: f64,
}

/// Designs a notch at `frequency_hz` with quality factor `q` (frequency divided by -3 dB width),
/// like scipy's `iirnotch(frequency, q, fs=rate)`.
///
/// Expects `0 < frequency_hz < rate_hz / 2` and `q > 0`.
pub fn notch(frequency_hz: f64, q: f64, rate_hz: f64) -> Notch {
    let w0 = 2.0 * PI * frequency_hz / rate_hz;
    Notch {
        gain: 1.0 / (1.0 + (w0 / (2.0 * q)).tan()),
        cosine: -2.0 * w0.cos(),
    }
}

#[expect(clippy::cast_precision_loss, reason = "filter orders are below 100")]
fn real(count: usize) -> f64 {
    count as f64
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "order < 100"
)]
fn as_power(order: usize) -> i32 {
    order as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_band_pass_equals_scipy_s() {
        // Gain and largest pole radius of scipy 1.17:
        // butter(5, [0.5, 60], 'bandpass', fs=512, output='zpk').
        let filter = butterworth_band_pass(5, 0.5, 60.0, 512.0);
        assert!(
            (filter.gain - 0.002_419_698_231_044_458).abs() < 1e-15,
            "{}",
            filter.gain
        );
        let radius = filter.poles.iter().map(|p| p.norm()).fold(0.0, f64::max);
        assert!((radius - 0.998_130_097_811_680_8).abs() < 1e-12, "{radius}");
    }

    #[test]
    fn the_mains_notch_equals_scipy_s() {
        // scipy 1.17: iirnotch(50, 30, 512).
        let n = notch(50.0, 30.0, 512.0);
        assert!((n.gain - 0.989_876_635_481_953_6).abs() < 1e-15);
        assert!((n.gain * n.cosine + 1.618_616_208_127_262_8).abs() < 1e-14);
    }
}
