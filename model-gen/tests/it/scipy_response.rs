//! Compares the quantised cascades with scipy's transfer functions. `scipy_response.py` in this
//! folder printed the golden numbers.

use model_gen::{
    FilterSpec, butterworth_band_pass, cascade, headroom, notch, response::frequency_response,
};
use num_complex::Complex64;

const GOLDEN: &str = include_str!("scipy_response.csv");

/// Iterates over the lines of the golden file: filter specification, frequency in Hz, complex gain.
fn golden() -> impl Iterator<Item = (FilterSpec, f64, Complex64)> {
    GOLDEN.lines().filter(|line| !line.starts_with('#')).map(|line| {
        let numbers: Vec<f64> =
            line.split(',').map(|n| n.parse().expect("the golden file holds numbers")).collect();
        let [rate, mains, _, hz, re, im] = numbers[..] else { panic!("six columns in {line}") };
        let harmonics = line.split(',').nth(2).expect("six columns");
        let spec = FilterSpec {
            harmonics: harmonics.parse().expect("a whole number"),
            ..spec(rate, mains)
        };
        (spec, hz, Complex64::new(re, im))
    })
}

fn spec(rate_hz: f64, mains_hz: f64) -> FilterSpec {
    FilterSpec { rate_hz, mains_hz, notch_q: 30.0, harmonics: 0, band_hz: [0.5, 60.0], order: 5 }
}

#[test]
fn the_design_equals_scipy_s_to_1e_9() {
    for (spec, hz, expected) in golden() {
        let rate = spec.rate_hz;
        let z = Complex64::from_polar(1.0, 2.0 * std::f64::consts::PI * hz / rate);
        let band = butterworth_band_pass(5, 0.5, 60.0, rate);
        let zeros = ((z - 1.0) * (z + 1.0)).powi(5);
        let poles: Complex64 = band.poles.iter().map(|pole| z - pole).product();
        let notches: Complex64 = (1..=spec.harmonics + 1)
            .map(|multiple| {
                let notch = notch(f64::from(multiple) * spec.mains_hz, 30.0, rate);
                let numerator = notch.gain * (z * z + notch.cosine * z + 1.0);
                let denominator = z * z + notch.gain * notch.cosine * z + (2.0 * notch.gain - 1.0);
                numerator / denominator
            })
            .product();
        let found = band.gain * zeros / poles * notches;
        // The largest measured difference from scipy is 4e-13.
        assert!((found - expected).norm() < 1e-9, "{hz} Hz at {rate} Hz: {found} {expected}");
    }
}

#[test]
fn the_quantised_cascade_has_scipy_s_response_at_every_rate() {
    let mut worst = 0.0_f64;
    let mut lines = 0;
    for (spec, hz, expected) in golden() {
        let sections = cascade(&spec).expect("the specification is realisable");
        let error = (frequency_response(&sections, hz, spec.rate_hz) - expected).norm();
        worst = worst.max(error);
        lines += 1;
    }
    // The golden file has six rates with 0, 1 and 2 harmonics (but not 2 at 250 and 256 Hz, where
    // the highest notch would exceed half the rate), two mains frequencies and 17 frequencies.
    assert_eq!(lines, (6 * 3 - 2) * 2 * 17);
    // Coefficients have 32 fraction bits, a rounding error of 1.2e-10. The poles of the 0.5 Hz
    // high-pass, at radius r, amplify it by 1 / (1 - r)^2 close to the band edge. The largest
    // measured deviation is 2.1e-5, at 0.5 Hz and a rate of 1000 Hz.
    assert!(worst < 5e-5, "largest deviation {worst:e}");
}

#[test]
fn the_error_of_an_unrealisable_specification_states_number_and_reason() {
    type Change = fn(&mut FilterSpec);
    let cases: [(Change, &str); 16] = [
        (|s| s.band_hz[1] = 300.0, "upper band edge of 300 Hz"),
        (|s| s.band_hz[1] = 256.0, "upper band edge of 256 Hz"),
        (|s| s.rate_hz = 100.0, "mains frequency of 50 Hz"),
        (|s| s.band_hz = [60.0, 0.5], "from 60 to 0.5 Hz is empty"),
        (|s| s.band_hz[0] = 60.0, "from 60 to 60 Hz is empty"),
        (|s| s.order = 0, "order 0"),
        (|s| s.order = 9, "order 9 is out of range"),
        (|s| s.notch_q = -1.0, "quality -1"),
        (|s| s.notch_q = 0.08, "quality 0.08"),
        (|s| s.band_hz[0] = f64::NAN, "lower band edge of NaN"),
        (|s| s.band_hz[0] = 1e-6, "section 1 is unstable"),
        (|s| s.notch_q = 1e11, "section 0 is unstable"),
        (|s| s.band_hz[0] = 1e-7, "too close to the real axis"),
        (
            |s| s.harmonics = 5,
            "with 5 harmonics of 50 Hz mains the last notch is at 300 Hz, but it must be below 256 Hz",
        ),
        (|s| s.harmonics = u32::MAX, "4294967295 harmonics"),
        (
            |s| (s.rate_hz, s.harmonics) = (1_024.0, 7),
            "with 7 harmonics and a band-pass of order 5 the filters have 13 sections, at most 12 are possible",
        ),
    ];
    for (change, expected) in cases {
        let mut spec = spec(512.0, 50.0);
        change(&mut spec);
        let error = cascade(&spec).expect_err(expected).to_string();
        assert!(error.contains(expected), "`{error}` lacks `{expected}`");
    }
}

#[test]
fn a_band_that_could_overflow_or_settles_too_slowly_is_refused() {
    let refused = |low: f64, order: usize| {
        let spec = FilterSpec { band_hz: [low, 60.0], order, ..spec(512.0, 50.0) };
        let sections = cascade(&spec).expect("stable sections");
        headroom::prove_cascade(&sections).expect_err("no room").to_string()
    };
    // The worst-case gain of the node `pair of section 4` is 8.45, above the limit of 8. Only the
    // whole response shows this: the L1 norm of its first 40,000 samples is 7.75.
    assert!(refused(0.01, 5).contains("pair of section 4"));
    assert!(refused(0.5, 8).contains("times the input"));
    assert!(refused(5e-4, 1).contains("decays over"));
}
