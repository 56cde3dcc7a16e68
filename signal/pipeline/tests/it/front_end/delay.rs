//! The stated group delay of the whole front end, compared with its output.

use std::f64::consts::PI;

use artifact::Decimation;

use super::{AtRate, STEP_RATE_HZ};

/// Length of the burst, s.
const BURST_S: f64 = 8.0;
/// Length of the input, s.
const SECONDS: u32 = 12;

/// Returns the value at `time_s` of a 10 Hz burst as sine and as cosine. Its Hann envelope starts
/// at 1 s; the peak is 1.
fn burst(time_s: f64) -> [f64; 2] {
    let part = (time_s - 1.0) / BURST_S;
    if !(0.0..1.0).contains(&part) {
        return [0.0; 2];
    }
    let envelope = (PI * part).sin().powi(2);
    let (sine, cosine) = (2.0 * PI * 10.0 * time_s).sin_cos();
    [envelope * sine, envelope * cosine]
}

/// Returns the envelope, at a delay of `delay_s`, of the cross-correlation of the steps with the
/// burst. The group delay moves this envelope; the phase delay moves the wave inside it.
fn correlation(steps: &[f64], delay_s: f64) -> f64 {
    let mut time_s = -delay_s;
    let mut sums = [0.0; 2];
    for y in steps {
        for (sum, wave) in sums.iter_mut().zip(burst(time_s)) {
            *sum += y * wave;
        }
        time_s += 1.0 / f64::from(STEP_RATE_HZ);
    }
    f64::hypot(sums[0], sums[1])
}

/// Returns the delay of the correlation's peak in seconds, found by ternary search.
fn peak(steps: &[f64]) -> f64 {
    let (mut low, mut high) = (0.0, 0.25);
    while high - low > 1e-7 {
        let third = (high - low) / 3.0;
        if correlation(steps, low + third) < correlation(steps, high - third) {
            low += third;
        } else {
            high -= third;
        }
    }
    f64::midpoint(low, high)
}

#[test]
fn a_burst_is_delayed_by_the_stated_group_delay_at_every_rate() {
    for (rate_hz, decimation) in [
        (250, Decimation::Fir),
        (256, Decimation::Literal),
        (256, Decimation::Fir),
        (500, Decimation::Fir),
        (512, Decimation::Literal),
        (512, Decimation::Fir),
        (1000, Decimation::Fir),
        (1024, Decimation::Literal),
        (1024, Decimation::Fir),
    ] {
        for mains_hz in [50, 60] {
            let front_end = AtRate::new(rate_hz, mains_hz, decimation);
            // The burst has a peak of 10 mV; one count is 113 dB below this peak.
            #[expect(clippy::cast_possible_truncation, reason = "447,392 counts")]
            let count =
                |n: u32| (447_392.0 * burst(f64::from(n) / f64::from(rate_hz))[0]).round() as i32;
            let counts: Vec<i32> = (0..SECONDS * rate_hz).map(count).collect();
            let found_us = peak(&front_end.steps(&counts)) * 1e6;
            let stated_us = front_end.chain().group_delay_s(10.0) * 1e6;
            println!(
                "{rate_hz} Hz, mains {mains_hz} Hz, {decimation:?}: {found_us:.0} us, stated \
                 {stated_us:.0} us"
            );
            // Largest measured difference between the two delays: 1 us.
            assert!((found_us - stated_us).abs() < 5.0);
        }
    }
}

#[test]
fn the_model_states_the_delay_of_its_own_front_end() {
    let decimation = if model::TAPS == 1 {
        Decimation::Literal
    } else {
        Decimation::Fir
    };
    for mains in [&model::MAINS_50, &model::MAINS_60] {
        let rate_hz = model::ADC_RATE_HZ.into();
        let front_end = AtRate::new(rate_hz, mains.mains_hz.into(), decimation);
        let stated_us = f64::from(mains.group_delay_us);
        assert!((front_end.chain().group_delay_s(10.0) * 1e6 - stated_us).abs() < 1.0);
    }
}
