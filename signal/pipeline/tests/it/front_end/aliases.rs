//! Aliases of tones above half of the step rate.

use std::f64::consts::PI;

use artifact::Decimation;

use super::{AtRate, STEP_RATE_HZ};

/// Amplitude of a tone in counts: 50 mV, far below the rail and far above the rounding.
const AMPLITUDE: f64 = 2_236_962.0;
/// Length of a tone in seconds; the filters settle well before its second half.
const SECONDS: u32 = 32;

/// Returns the gain from a tone at `hz` to its alias at the step rate.
fn alias(front_end: &AtRate, hz: u32) -> f64 {
    let rate = f64::from(front_end.rate_hz);
    #[expect(clippy::cast_possible_truncation, reason = "2.2 million counts")]
    let tone = |n: u32| {
        (AMPLITUDE * (2.0 * PI * f64::from(hz) * f64::from(n) / rate).sin()).round() as i32
    };
    let counts: Vec<i32> = (0..SECONDS * front_end.rate_hz).map(tone).collect();
    let steps = front_end.steps(&counts);
    let tail = &steps[steps.len() / 2..];
    let image = (hz % STEP_RATE_HZ).min(STEP_RATE_HZ - hz % STEP_RATE_HZ);
    let radians = 2.0 * PI * f64::from(image) / f64::from(STEP_RATE_HZ);
    let (mut re, mut im, mut length) = (0.0, 0.0, 0.0);
    for y in tail {
        re += y * f64::cos(radians * length);
        im += y * f64::sin(radians * length);
        length += 1.0;
    }
    2.0 * f64::hypot(re, im) / length / AMPLITUDE
}

#[test]
fn aliases_have_the_designed_attenuation() {
    let table = [Decimation::Literal, Decimation::Fir].map(|decimation| {
        let front_end = AtRate::new(512, 50, decimation);
        [68, 78, 100, 150].map(|hz| {
            let expected = front_end.chain().frequency_response(f64::from(hz)).norm();
            let found = alias(&front_end, hz);
            let [found_db, expected_db] = [found, expected].map(|gain| 20.0 * gain.log10());
            println!("{decimation:?}: {hz} Hz at {found_db:.1} dB, designed {expected_db:.1} dB");
            // Rounding the tone to counts adds noise 150 dB below the tone; 1e-7 is -140 dB.
            assert!((found - expected).abs() < 1e-3 * expected + 1e-7);
            found_db
        })
    });
    let [literal, fir] = table;
    // Gains in dB: those stated for the paper's literal decimation, and upper limits for decimation
    // with an anti-aliasing filter.
    for (found, stated) in literal.into_iter().zip([-7.1, -13.2, -26.4, -53.6]) {
        assert!((found - stated).abs() < 0.1, "{found} instead of {stated}");
    }
    for (found, limit) in fir.into_iter().zip([-23.0, -68.0, -110.0, -110.0]) {
        assert!(found < limit, "{found} instead of {limit}");
    }
}
