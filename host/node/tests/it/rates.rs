//! Stamps of acquisitions whose true rate differs from the rate that they state.

use neuro_ros::{DiagnosticLevel, DiagnosticStatus};

use crate::acquisition::Acquisition;
use crate::harness::{Harness, START};

/// Seconds after the start, and after the pause, during which the tests do not check the clock.
const SETTLING_S: f64 = 12.0;

/// A simulated amplifier, whose true rate differs from the rate that it states.
struct Amplifier {
    rate_hz: u16,
    frame_samples: u16,
    /// True rate divided by the stated rate, minus 1, parts per million.
    rate_error_ppm: f64,
    /// Length of a pause after 20 s, seconds.
    pause_s: f64,
}

#[test]
fn stamps_follow_the_true_rate_within_a_millisecond() {
    println!("  rate  frame  error ppm  pause s | drift ppm  p99 ms  max ms");
    let case = |rate_hz, frame_samples, rate_error_ppm, pause_s| Amplifier {
        rate_hz,
        frame_samples,
        rate_error_ppm,
        pause_s,
    };
    let rate = model::ADC_RATE_HZ;
    for amplifier in [
        case(rate, 32, 40.0, 0.0),
        case(rate, 32, -4_000.0, 0.0),
        case(rate, 32, 30_000.0, 0.0),
        case(rate, 32, -30_000.0, 0.0),
        case(rate, 32, -4_000.0, 100.0),
        case(rate, 20, -4_000.0, 0.0),
        case(rate, 256, 4_000.0, 0.0),
        case(160, 10, 4_000.0, 0.0),
        case(250, 16, -4_000.0, 30.0),
        case(500, 25, 40.0, 0.0),
        case(1000, 50, 30_000.0, 0.0),
        case(2000, 50, -4_000.0, 0.0),
    ] {
        let Amplifier { rate_hz, frame_samples, rate_error_ppm, pause_s } = amplifier;
        let (clock, mut errors_ms) = run(&amplifier);
        let drift = clock.values.iter().find(|value| value.key == "drift ppm");
        let drift_ppm: f64 = drift.unwrap().value.parse().unwrap();
        errors_ms.sort_by(f64::total_cmp);
        let p99 = errors_ms[errors_ms.len() * 99 / 100];
        let max = errors_ms[errors_ms.len() - 1];
        println!(
            "{rate_hz:6} {frame_samples:6} {rate_error_ppm:10.0} {pause_s:8.1} | {drift_ppm:9.1} {p99:7.3} {max:7.3}"
        );
        // The drift is the relative error of the sample period, which is the inverse of the rate.
        let expected_ppm = (1.0 / (1.0 + rate_error_ppm * 1e-6) - 1.0) * 1e6;
        assert!((drift_ppm - expected_ppm).abs() < 50.0, "{clock:?}");
        let is_warning = clock.level == DiagnosticLevel::Warn;
        assert_eq!(is_warning, rate_error_ppm.abs() > 1000.0, "{clock:?}");
        assert!(p99 < 0.5 && max < 1.0);
    }
}

/// Simulates 60 s. Returns the last status `clock`, and the errors of the stamps of all codes after
/// [`SETTLING_S`], milliseconds.
#[expect(clippy::cast_precision_loss, reason = "some minutes")]
fn run(amplifier: &Amplifier) -> (DiagnosticStatus, Vec<f64>) {
    let acquisition = Acquisition::new(amplifier.rate_hz, amplifier.frame_samples);
    let true_rate = f64::from(amplifier.rate_hz) * (1.0 + amplifier.rate_error_ppm * 1e-6);
    // Returns when a sample was made: the time since the first sample of the first frame, seconds.
    let made_s = |sample: f64| {
        let at = sample / true_rate;
        if at > 20.0 { at + amplifier.pause_s } else { at }
    };
    let mut hash = 1_u32;
    let mut delay_s = || {
        hash = hash.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // Up to 4 ms, but less than 1 ms for most frames.
        4e-3 * (f64::from(hash >> 8) / f64::from(1 << 24)).powi(4)
    };
    let frames = u32::from(amplifier.rate_hz) * 60 / u32::from(amplifier.frame_samples);
    let mut harness = Harness::new(&acquisition.frame(0));
    let first_s = made_s(f64::from(amplifier.frame_samples));
    let (mut now_us, mut stamped) = (0, Vec::new());
    for index in 1..frames {
        let end = f64::from((index + 1) * u32::from(amplifier.frame_samples));
        let read_s = made_s(end - 1.0) + 1.0 / true_rate - first_s + delay_s();
        #[expect(clippy::cast_possible_truncation, reason = "some minutes")]
        let read_us = (read_s * 1e6) as i64;
        harness.receive(&acquisition.frame(index), read_us - now_us).unwrap();
        now_us = read_us;
        stamped.resize(harness.recorder.encoded.len(), read_s);
    }
    // The stamp is the time of the window's first sample, minus the filters' delay.
    let delay = f64::from(pipeline::Mains::Hz50.filter().group_delay_us)
        * 1e-6
        * f64::from(amplifier.rate_hz);
    let hop = model::HOP as f64 / f64::from(model::STEP_RATE_HZ) * f64::from(amplifier.rate_hz);
    let codes = harness.recorder.encoded.iter().zip(&stamped).enumerate();
    let errors = codes.filter_map(|(window, (frame, read_s))| {
        let sample = window as f64 * hop;
        let settled = |since: f64| !(since..since + SETTLING_S).contains(read_s);
        if !settled(0.0) || (amplifier.pause_s > 0.0 && !settled(20.0 + amplifier.pause_s)) {
            return None;
        }
        let stamp_s = (frame.header.stamp.nanoseconds() - START.wall_ns) as f64 * 1e-9;
        let expected_s = made_s(sample) - delay / true_rate - first_s;
        Some(((stamp_s - expected_s) * 1e3).abs())
    });
    let errors = errors.collect();
    (harness.status("corticode: clock"), errors)
}
