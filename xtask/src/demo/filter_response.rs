//! The magnitude of the fixed-point filters, measured with an impulse.

use std::f64::consts::PI;

use fixed_dsp::Resampler;
use pipeline::{FrontEnd, Mains, Sample};

use crate::picture::response::{Design, Response};

/// The impulse, counts: half of full scale, so that the rounding of Q27.5 lies 156 dB below.
const IMPULSE: i32 = 1 << 22;
/// Length of the measured response, s: the slowest poles, 2 pi 0.5 Hz sin(18 deg) = 0.97 / s, have
/// decayed by e^-15. Longer only gathers rounding noise.
const SECONDS: u32 = 16;
const POINTS: u32 = 900;

/// Measures the filters for 50 Hz mains.
pub(crate) fn measure() -> Response {
    let rate_hz = f64::from(model::ADC_RATE_HZ);
    let design = Design {
        rate_hz,
        mains_hz: 50.0,
        notch_q: 30.0,
        band_hz: [0.5, 60.0],
        order: 5,
    };
    let impulse_response = impulse_response();
    let (first, last) = (0.1_f64, rate_hz / 2.0);
    let steps = (0..=POINTS).map(|step| f64::from(step) / f64::from(POINTS));
    let mut frequencies: Vec<f64> = steps
        .map(|part| first * (last / first).powf(part))
        .collect();
    // The notch is narrower than a step of the axis.
    frequencies.extend((-8..=8).map(|step| design.mains_hz + f64::from(step) * 0.05));
    frequencies.sort_by(f64::total_cmp);
    let measured = frequencies
        .into_iter()
        .map(|hz| (hz, magnitude_db(&impulse_response, 2.0 * PI * hz / rate_hz)))
        .collect();
    let mut response = Response {
        design,
        measured,
        subtitle: String::new(),
    };
    response.subtitle = format!(
        "50 Hz notch and Butterworth-5 band-pass, {rate_hz} Hz, before decimation; within {:.2} dB \
         of the design down to −40 dB",
        response.worst_error_db()
    );
    response
}

/// Response to one sample of [`IMPULSE`] counts, relative to it. Without decimation: the filters
/// alone, at the ADC's rate.
///
/// Half the difference of the responses to the impulse and to its negative: what does not depend
/// on the signal, such as the start of the carried rounding error, cancels.
fn impulse_response() -> Vec<f64> {
    let every = Resampler::every(1);
    let mut front_end = FrontEnd::new(Mains::Hz50, &every);
    let mut sample = Sample::default();
    [sample.counts[0], sample.counts[1]] = [IMPULSE, -IMPULSE];
    let samples = SECONDS * u32::from(model::ADC_RATE_HZ);
    (0..samples)
        .filter_map(|_| {
            let filtered = front_end.push(&sample);
            sample = Sample::default();
            filtered
        })
        .map(|([up, down, ..], _)| f64::from(up) - f64::from(down))
        .map(|both| both / f64::from(1 << model::GUARD_BITS) / 2.0 / f64::from(IMPULSE))
        .collect()
}

/// Magnitude of the Fourier sum at an angular frequency in radians per sample, dB.
fn magnitude_db(response: &[f64], angle: f64) -> f64 {
    let (step_re, step_im) = (angle.cos(), -angle.sin());
    // Horner's rule: one complex product per sample instead of a sine and a cosine.
    let (re, im) = response.iter().rev().fold((0.0, 0.0), |(re, im), h| {
        (re * step_re - im * step_im + h, re * step_im + im * step_re)
    });
    10.0 * (re * re + im * im).log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measured_filters_are_the_designed_ones() {
        let response = measure();
        // Measured 0.074 dB, near -40 dB; the rest is room for another rounding inside the filters.
        let error = response.worst_error_db();
        assert!(error < 0.1, "{error} dB");
        let notch = response
            .measured
            .iter()
            .find(|(hz, _)| (hz - 50.0).abs() < 1e-9);
        assert!(notch.is_some_and(|(_, db)| *db < -60.0), "{notch:?}");
    }
}
