//! Tones above the steps' Nyquist frequency, and what they leave below it.

use std::f64::consts::PI;

use artifact::Decimation;

use crate::at_rate::{AtRate, STEP_RATE_HZ};

/// 50 mV, far below the rail and far above any rounding.
const AMPLITUDE: f64 = 2_236_962.0;
/// Settled well before the second half.
const SECONDS: u32 = 32;

/// What a tone at `hz` leaves at the frequency onto which it folds, relative to it.
fn folded(front_end: &AtRate, hz: u32) -> f64 {
    let rate = f64::from(front_end.rate_hz);
    #[expect(clippy::cast_possible_truncation, reason = "2.2 million counts")]
    let tone = |n: u32| {
        (AMPLITUDE * (2.0 * PI * f64::from(hz) * f64::from(n) / rate).sin()).round() as i32
    };
    let counts: Vec<i32> = (0..SECONDS * front_end.rate_hz).map(tone).collect();
    let steps = front_end.steps(&counts);
    let tail = &steps[steps.len() / 2..];
    let image = (hz % STEP_RATE_HZ).min(STEP_RATE_HZ - hz % STEP_RATE_HZ);
    let turn = 2.0 * PI * f64::from(image) / f64::from(STEP_RATE_HZ);
    let (mut re, mut im, mut length) = (0.0, 0.0, 0.0);
    for y in tail {
        re += y * f64::cos(turn * length);
        im += y * f64::sin(turn * length);
        length += 1.0;
    }
    2.0 * f64::hypot(re, im) / length / AMPLITUDE
}

#[test]
fn tones_fold_as_far_down_as_the_design_says() {
    let table = [Decimation::Literal, Decimation::Fir].map(|decimation| {
        let front_end = AtRate::new(512, 50, decimation);
        [68, 78, 100, 150].map(|hz| {
            let expected = front_end.chain().frequency_response(f64::from(hz)).norm();
            let found = folded(&front_end, hz);
            let [found_db, expected_db] = [found, expected].map(|gain| 20.0 * gain.log10());
            println!("{decimation:?}: {hz} Hz at {found_db:.1} dB, designed {expected_db:.1} dB");
            // Rounding to counts leaves noise at -150 dB of the tone.
            assert!((found - expected).abs() < 1e-3 * expected + 1e-7);
            found_db
        })
    });
    let [literal, fir] = table;
    // What the paper's way lets through, and what the alias-free way promises.
    for (found, stated) in literal.into_iter().zip([-7.1, -13.2, -26.4, -53.6]) {
        assert!((found - stated).abs() < 0.1, "{found} instead of {stated}");
    }
    for (found, promised) in fir.into_iter().zip([-23.0, -68.0, -110.0, -110.0]) {
        assert!(found < promised, "{found} instead of {promised}");
    }
}
