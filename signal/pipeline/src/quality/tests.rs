//! Tests of the quality figures: of single signals against a float64 reference, and of the output
//! of the whole acquisition.

use std::{f64::consts::TAU, vec::Vec};

use super::*;
use crate::acquisition::Acquisition;

fn counts_per_uv() -> f64 {
    1000.0 / f64::from(LSB_NV)
}

/// Returns sample `n` of the signal `uv(electrode, seconds)`, converted from microvolts to counts.
fn sample(n: u32, uv: impl Fn(usize, f64) -> f64) -> Sample {
    let t = f64::from(n) / f64::from(ADC_RATE_HZ);
    let mut sample = Sample::default();
    for (electrode, count) in sample.counts.iter_mut().enumerate() {
        #[expect(clippy::cast_possible_truncation, reason = "the tests stay within the rails")]
        let rounded = (uv(electrode, t) * counts_per_uv()).round() as i32;
        *count = rounded;
    }
    sample
}

/// Returns the RMS at `hz` Hz of a one-second `signal`, computed with a Hann window in float64.
fn reference(hz: f64, signal: &[f64]) -> f64 {
    let length = f64::from(u32::try_from(signal.len()).expect("a second"));
    let (mut re, mut im) = (0.0, 0.0);
    for (n, x) in (0..).zip(signal) {
        let angle = TAU * f64::from(n) / length;
        let x = x * (1.0 - angle.cos());
        re += x * (hz * angle).cos();
        im += x * (hz * angle).sin();
    }
    2.0_f64.sqrt() * re.hypot(im) / length
}

fn report(quality: &mut SignalQuality, samples: impl Iterator<Item = Sample>) -> Quality {
    let reports: Vec<Quality> = samples.filter_map(|s| quality.observe(&s, None)).collect();
    *reports.last().expect("a whole second")
}

fn second() -> core::ops::Range<u32> {
    0..u32::from(ADC_RATE_HZ)
}

#[test]
fn every_second_ends_with_a_report_that_carries_its_first_sample() {
    let mut quality = SignalQuality::new(Mains::Hz50);
    let rate = usize::from(ADC_RATE_HZ);
    let reports: Vec<(usize, u64)> = (0..3 * rate)
        .filter_map(|n| Some((n, quality.observe(&Sample::default(), None)?.first_sample)))
        .collect();
    let expected = [1, 2, 3].map(|second| (second * rate - 1, ((second - 1) * rate) as u64));
    assert_eq!(reports, expected);
}

#[test]
fn a_microvolt_of_mains_is_measured_despite_20_mv_of_offset_alpha_and_drift() {
    for (mains, hz) in [(Mains::Hz50, 50.0), (Mains::Hz60, 60.0)] {
        let amplitude = |electrode| 1.0 + 0.5 * f64::from(u8::try_from(electrode).expect("64"));
        let uv = |electrode: usize, t: f64| {
            let offset = if electrode.is_multiple_of(2) { 20e3 } else { -20e3 };
            let alpha = 30.0 * (TAU * 10.3 * t).sin();
            offset + 200.0 * t + alpha + amplitude(electrode) * (TAU * hz * t + 0.4).sin()
        };
        let samples: Vec<Sample> = second().map(|n| sample(n, uv)).collect();
        let report = report(&mut SignalQuality::new(mains), samples.iter().copied());
        for (index, electrode) in report.electrodes.iter().enumerate() {
            let signal: Vec<f64> = samples
                .iter()
                .map(|sample| f64::from(sample.counts[index]) / counts_per_uv())
                .collect();
            let (read, exact) = (f64::from(electrode.mains_uv), reference(hz, &signal));
            // The f32 phases cause a relative error of up to 3e-5. Rounding adds 1e-7 times the
            // offset of 20 mV: 2e-3 uV.
            let bound = 3e-5 * exact + 2e-3;
            assert!((read - exact).abs() < bound, "{read} instead of {exact} uV");
            // The ADC's rounding and the window's leakage separate the reading from the true RMS.
            // Measured difference: 1.4 nV.
            let truth = amplitude(index) / 2.0_f64.sqrt();
            assert!((read - truth).abs() < 0.003, "{read} of {truth} uV");
        }
    }
}

#[test]
fn filtered_figures_equal_those_of_float64() {
    let mut quality = SignalQuality::new(Mains::Hz60);
    let (rate, step_rate) = (u32::from(ADC_RATE_HZ), u32::from(STEP_RATE_HZ));
    let per_uv = counts_per_uv() * f64::from(1 << GUARD_BITS);
    let filtered = |electrode: usize, n: u32| {
        let t = f64::from(n) / f64::from(rate);
        let size = 1.0 + f64::from(u8::try_from(electrode).expect("61"));
        size * ((TAU * 11.0 * t).sin() + 0.05 * (TAU * 60.0 * t + 1.0).cos())
    };
    let mut steps: Vec<Step> = Vec::new();
    let mut reports = Vec::new();
    for n in second() {
        #[expect(clippy::cast_possible_truncation, reason = "62 uV")]
        let step = (n * step_rate % rate < step_rate).then(|| Step {
            electrodes: core::array::from_fn(|e| (filtered(e, n) * per_uv).round() as i32),
            ..Step::default()
        });
        steps.extend(step);
        reports.extend(quality.observe(&Sample::default(), step.as_ref()));
    }
    for (index, electrode) in reports[0].electrodes.iter().enumerate() {
        let signal: Vec<f64> =
            steps.iter().map(|step| f64::from(step.electrodes[index]) / per_uv).collect();
        let rms = (signal.iter().map(|x| x * x).sum::<f64>() / f64::from(step_rate)).sqrt();
        let relative = f64::from(electrode.rms_uv) / rms - 1.0;
        // The square root has a relative error of up to 2e-6, and the f32 sum is rounded. Measured
        // relative error: 9e-8.
        assert!(relative.abs() < 3e-6, "{relative} of {rms} uV");
        let residual = reference(60.0, &signal);
        let relative = f64::from(electrode.mains_residual_uv) / residual - 1.0;
        // The f32 phases cause a relative error of up to 3e-5. Measured relative error: 2.6e-6.
        assert!(relative.abs() < 3e-5, "{relative} of {residual} uV");
    }
}

#[test]
fn mains_is_measured_before_the_notch_and_removed_after_it() {
    for (mains, hz) in [(Mains::Hz50, 50.0), (Mains::Hz60, 60.0)] {
        let uv = |_, t: f64| 5000.0 + 30.0 * (TAU * 10.0 * t).sin() + 100.0 * (TAU * hz * t).sin();
        let mut acquisition = Acquisition::new(mains);
        let mut quality = SignalQuality::new(mains);
        let reports: Vec<Quality> = (0..30 * u32::from(ADC_RATE_HZ))
            .filter_map(|n| {
                let sample = sample(n, uv);
                let step = acquisition.process_sample(&sample);
                quality.observe(&sample, step.as_ref())
            })
            .collect();
        assert!(reports[0].settling);
        let last = reports.last().expect("30 s");
        assert!(!last.settling);
        let electrode = last.electrodes[ELECTRODES - 1];
        assert!((electrode.mains_uv - 70.71).abs() < 0.01, "{electrode:?}");
        // Measured residual: 0.6 nV, which is the noise of the filters.
        assert!(electrode.mains_residual_uv < 0.002, "{electrode:?}");
        // A sine with an amplitude of 30 uV has an RMS of 21.21 uV; the gain of the pass band at 10
        // Hz is 1 within 0.1 %.
        assert!((electrode.rms_uv - 21.21).abs() < 0.05, "{electrode:?}");
    }
}

#[test]
fn rails_are_counted_and_an_electrode_below_the_converter_s_noise_is_flat() {
    let mut quality = SignalQuality::new(Mains::Hz50);
    let samples = second().map(|n| {
        let mut sample = Sample::default();
        sample.counts[0] = if n < 100 { Sample::MAX } else { 0 };
        sample.counts[1] = -Sample::MAX - 1;
        // Limit for a flat electrode: 0.49 uV. 21 counts are 0.47 uV, below the limit; 22 counts
        // are 0.492 uV, above it.
        sample.counts[2] = 1_000_000 + if n == 77 { 21 } else { 0 };
        sample.counts[3] = if n == 77 { -22 } else { 0 };
        sample
    });
    let electrodes = report(&mut quality, samples).electrodes;
    let seen = |index: usize| (electrodes[index].samples_at_rail, electrodes[index].flat);
    assert_eq!(seen(0), (100, false));
    assert_eq!(seen(1), (ADC_RATE_HZ, true));
    assert_eq!((seen(2), seen(3)), ((0, true), (0, false)));
    assert!(electrodes[4].mains_uv < 1e-12 && electrodes[4].rms_uv < 1e-12);
}

#[test]
fn a_report_does_not_depend_on_the_second_before() {
    let large = |n| sample(n, |_, t| 1000.0 * (TAU * 50.0 * t).sin());
    let small = |n| sample(n, |_, t| 3.0 * (TAU * 50.0 * t).sin());
    let step = Step { electrodes: [1 << 20; ELECTRODES], settling: true, ..Step::default() };
    let mut quality = SignalQuality::new(Mains::Hz50);
    for n in second() {
        quality.observe(&large(n), Some(&step));
    }
    let after = report(&mut quality, second().map(small));
    let fresh = report(&mut SignalQuality::new(Mains::Hz50), second().map(small));
    assert_eq!(after.electrodes, fresh.electrodes);
    assert!(!after.settling);
}
