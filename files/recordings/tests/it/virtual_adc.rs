//! Tests the output of the virtual ADC for synthetic files.

use std::f64::consts::TAU;

use recordings::{
    AdcSpec, Missing, MontageMap, RecordingError, VirtualAdc, Warning, virtual_adc::AdcCounters,
};

use crate::{
    files::{EdfFile, EdfSignal, GdfFile, GdfSignal},
    open, played,
};

const ADS1299: AdcSpec = AdcSpec::ads1299(512);

/// Largest error of a constant, uV: half a count of 22.35 nV, and a margin of about 1e-10.
const HALF_COUNT_UV: f64 = 0.011_175_9;

/// Amplitude of tones, uV, relative to which rounding by half a count is an error of -139 dB.
const TONE_UV: f64 = 100_000.0;
/// Offset that is added to every tone, uV.
const OFFSET_UV: f64 = 20_000.0;
/// Electrodes in the files of [`tones`]; each electrode's signal is a tone.
const TONES: [&str; 4] = ["Fz", "Cz", "Pz", "Oz"];

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn seconds(sample: usize, rate: f64) -> f64 {
    sample as f64 / rate
}

/// Returns the value of a tone at a time after the start of the file, uV.
fn tone_uv(hz: f64, time_s: f64) -> f64 {
    OFFSET_UV + TONE_UV * (TAU * hz * time_s + 1.0).sin()
}

/// Builds a file of `records` records with `per_record` samples each. The duration of a record,
/// `record_s`, is a fraction (numerator, denominator). Each signal is a tone.
fn tones(hz: &[f64], per_record: u32, record_s: (u32, u32), records: usize) -> Vec<u8> {
    let rate = f64::from(per_record) * f64::from(record_s.1) / f64::from(record_s.0);
    let signals = TONES.into_iter().zip(hz).map(|(label, hz)| {
        let samples = 0..records * per_record as usize;
        let samples = samples.map(|sample| tone_uv(*hz, seconds(sample, rate)));
        GdfSignal {
            label,
            ..GdfSignal::with_type(17, per_record, samples.flat_map(f64::to_le_bytes).collect())
        }
    });
    let records = i64::try_from(records).expect("small");
    GdfFile { duration: record_s, ..GdfFile::version_2(records, signals.collect()) }.bytes()
}

/// Plays a file of tones. Returns the largest error of each tone, in dB relative to [`TONE_UV`], at
/// times at least `edge_s` away from both ends of the file. `expected` returns the value of a tone
/// in uV from its frequency and the time.
fn errors_db(file: Vec<u8>, hz: &[f64], edge_s: f64, expected: fn(f64, f64) -> f64) -> Vec<f64> {
    let (counts, counters) = play(file, &TONES[..hz.len()], Missing::Refuse);
    assert_eq!(counters, AdcCounters::default());
    let end_s = seconds(counts.len(), 512.0) - edge_s;
    let times = (0..counts.len()).map(|sample| seconds(sample, 512.0));
    let inside = times.zip(&counts).filter(|(time_s, _)| (edge_s..end_s).contains(time_s));
    let inside: Vec<_> = inside.collect();
    assert!(inside.len() > 256, "a quarter of a period of 0.5 Hz at least");
    let errors = hz.iter().enumerate().map(|(signal, hz)| {
        let errors = inside.iter().map(|(time_s, counts)| {
            (f64::from(counts[signal]) * ADS1299.lsb_uv - expected(*hz, *time_s)).abs()
        });
        20.0 * (errors.fold(0.0, f64::max) / TONE_UV).log10()
    });
    errors.collect()
}

/// Plays the electrode Cz of a file, without dither.
fn play_cz(bytes: Vec<u8>) -> (Vec<[i32; 64]>, AdcCounters) {
    play(bytes, &["Cz"], Missing::Refuse)
}

fn play(bytes: Vec<u8>, electrodes: &[&str], missing: Missing) -> (Vec<[i32; 64]>, AdcCounters) {
    let recording = open(bytes).expect("a valid file");
    let mut adc = played(recording, electrodes, missing).without_dither();
    let counts: Vec<_> = (&mut adc).collect::<Result<_, _>>().expect("readable");
    assert_eq!(counts.len() as u64, adc.samples());
    (counts, adc.counters())
}

#[test]
fn a_resampled_tone_is_the_tone_at_k_over_rate() {
    // The errors include all images. The largest measured error is -84.4 dB.
    println!("      Hz | error of 1, 10, 30, 60 Hz, dB");
    for rate_hz in [100, 128, 160, 250, 256, 500, 1000, 1024, 2000, 2048, 5000, 20_000] {
        // A rate that is lower by 0.3 Hz, in one record of 10 s, has a ratio to 512 Hz with large
        // terms.
        for per_record in [10 * rate_hz, 10 * rate_hz - 3] {
            let rate_hz = f64::from(per_record) / 10.0;
            // The pass band ends at 60 Hz or at 0.9 of half the rate, whichever is lower.
            let hz = [1.0, 10.0, 30.0, 60.0_f64.min(0.45 * rate_hz)];
            let errors = errors_db(tones(&hz, per_record, (10, 1), 1), &hz, 0.7, tone_uv);
            println!("{rate_hz:8.1} | {errors:6.1?}");
            assert!(errors.iter().all(|db| *db < -84.0), "{rate_hz} Hz: {errors:?}");
        }
    }
}

#[test]
fn a_ratio_of_large_terms_does_not_drift() {
    // At 256.004352.. Hz, the position of an output repeats only after 999,983 outputs. An error of
    // 1e-9 in the ratio would amount to -79 dB at 30 Hz after the 10 minutes.
    let hz = [10.0, 30.0];
    let file = tones(&hz, 256, (999_983, 1_000_000), 600);
    let errors = errors_db(file, &hz, 0.1, tone_uv);
    assert!(errors.iter().all(|db| *db < -84.0), "{errors:?}");
}

#[test]
fn what_is_above_half_the_rate_of_the_adc_is_not_aliased() {
    // 470 Hz would alias onto 42 Hz. The largest measured value is -91.9 dB.
    for rate in [1000, 2048, 5000] {
        let hz = [256.5, 300.0, 470.0, f64::from(rate) / 2.0 - 5.0];
        let left = errors_db(tones(&hz, rate, (1, 1), 2), &hz, 0.1, |_, _| OFFSET_UV);
        println!("{rate} Hz: {left:6.1?} dB are left");
        assert!(left.iter().all(|db| *db < -90.0), "{rate} Hz: {left:?}");
    }
}

#[test]
fn an_impulse_spreads_by_the_delay_to_both_sides_and_keeps_its_sum() {
    let mut samples = [0.0_f32; 512];
    samples[200] = 100_000.0;
    let (counts, _) = play_cz(GdfFile::float32(2, 256, &samples).bytes());
    let counts: Vec<i32> = counts.iter().map(|counts| counts[0]).collect();
    // At 256 Hz the filter has 16 taps, so it reaches 8 input samples, which are 16 ADC samples.
    assert!(counts[..=400 - 16].iter().all(|count| *count == 0));
    assert!(counts[400 + 16..].iter().all(|count| *count == 0));
    for distance in 0..16 {
        assert_eq!(counts[400 - distance], counts[400 + distance], "{distance}");
    }
    let sum = f64::from(counts.iter().sum::<i32>()) * ADS1299.lsb_uv;
    // Each of the 31 outputs is rounded.
    assert!((sum - 200_000.0).abs() < 31.0 * HALF_COUNT_UV, "{sum} uV");
}

#[test]
fn saturated_and_non_finite_samples_are_counted() {
    let samples = [f32::NAN, 1e6, -1e6, f32::INFINITY, 5.0, f32::NAN, 187_500.0, -187_500.0];
    let mut file = GdfFile::float32(1, 8, &samples);
    file.duration = (8, 512);
    let (counts, counters) = play_cz(file.bytes());
    let played: Vec<i32> = counts.iter().map(|c| c[0]).collect();
    // Full scale is 2^23 * 22.35 nV = 187.5 mV. The largest count is 2^23 - 1, so +187.5 mV
    // saturates and -187.5 mV does not.
    let (top, bottom) = (8_388_607, -8_388_608);
    assert_eq!(played, [0, top, bottom, bottom, 224, 224, top, bottom]);
    assert_eq!((counters.saturated, counters.not_finite), (4, 3));
}

#[test]
fn the_largest_floats_saturate_without_a_panic() {
    let samples = [f64::MAX; 320];
    let data = samples.into_iter().flat_map(f64::to_le_bytes).collect();
    let signal = GdfSignal::with_type(17, 160, data);
    let file = GdfFile::version_2(2, vec![signal]);
    let (counts, counters) = play_cz(file.bytes());
    assert!(counts.iter().all(|count| count[0] == 8_388_607));
    assert_eq!((counters.saturated, counters.not_finite), (1024, 0));
}

#[test]
fn voltage_units_are_converted_to_microvolts() {
    for (code, unit, value) in
        [(4256, "V", 1e-3), (4274, "mV", 1.0), (0, "uV", 1000.0), (4276, "", 1e6)]
    {
        let mut file = GdfFile::float32(1, 512, &[value; 512]);
        (file.signals[0].unit_code, file.signals[0].unit) = (code, unit);
        let (counts, _) = play_cz(file.bytes());
        // 1 mV is 1 mV / 22.351741790771484 nV = 44739.24 counts.
        assert_eq!(counts[7][0], 44_739, "{unit} {code}");
    }
}

#[test]
fn electrodes_can_combine_signals_of_different_rates() {
    let signals = vec![
        EdfSignal::int16("C3", 512, &[100; 512 * 8]),
        EdfSignal::int16("EEG C4", 256, &[200; 256 * 8]),
        EdfSignal::int16("Status", 1, &[7; 8]),
    ];
    let bytes = EdfFile::edf("8", signals).bytes();
    let electrodes = ["Cz", "C3", "C4", "Pz"];
    let (counts, _) = play(bytes.clone(), &electrodes, Missing::Interpolate);
    assert_eq!(counts.len(), 8 * 512);
    for sample in &counts {
        let uv = sample.map(|count| f64::from(count) * ADS1299.lsb_uv);
        // Cz and Pz are each equally far from C3 and C4, so both are the mean of C3 and C4: 150 uV.
        for (found, expected) in uv.iter().zip([150.0, 100.0, 200.0, 150.0, 0.0]) {
            let error = (found - expected).abs();
            assert!(error < HALF_COUNT_UV, "{found} uV, expected {expected}");
        }
    }
    let (counts, _) = play(bytes, &["Cz", "C3"], Missing::Zero);
    assert!(counts.iter().all(|sample| sample[..2] == [0, 4474]));
}

#[test]
fn a_rate_is_the_one_that_the_rounded_field_of_an_edf_header_means() {
    for (duration, per_record, rate_hz) in [
        (".0019531", 1, 512.0),
        ("0.005859", 3, 512.0),
        ("0.007812", 1, 128.0),
        ("0.999938", 256, 256.016),
        ("0.999941", 512, 512.03),
        ("0.999980", 1024, 1024.02),
    ] {
        let signal = EdfSignal::int16("Cz", per_record, &vec![1000; 64 * per_record]);
        let file = EdfFile { duration, ..EdfFile::edf("-1", vec![signal]) };
        let recording = open(file.bytes()).expect("usable");
        let read_hz = recording.signals()[0].rate.expect("samples").value();
        assert!((read_hz / rate_hz - 1.0).abs() < 1e-6, "{read_hz} Hz");
        let rounded = |warning: &Warning| matches!(warning, Warning::DurationRounded { .. });
        assert!(recording.warnings().iter().any(rounded), "{duration}");
        let mut adc = played(recording, &["Cz"], Missing::Refuse).without_dither();
        assert!(adc.all(|counts| counts.expect("readable")[0] == 44_739));
    }
}

#[test]
fn a_rate_that_is_1000_times_as_high_is_refused_and_a_low_one_is_not() {
    let adc = |per_record: u32, duration| {
        let file = GdfFile {
            duration,
            ..GdfFile::float32(1, per_record, &vec![1.0; per_record as usize])
        };
        let recording = open(file.bytes()).expect("usable");
        let map = MontageMap::new(&recording.labels(), &["Cz"], Missing::Zero).expect("Cz");
        VirtualAdc::new(recording, &map, ADS1299)
    };
    let error = adc(520, (1, 1000)).err().expect("520 kHz");
    let text = error.to_string();
    assert!(text.contains("resample the recording"), "{text}");
    assert_eq!(adc(510, (1, 1000)).expect("510 kHz").samples(), 0);
    // One sample every 116 days.
    let mut slow = adc(1, (10_000_000, 1)).expect("usable").without_dither();
    assert!(slow.by_ref().take(1000).all(|counts| counts.expect("readable")[0] == 45));
}

#[test]
fn impossible_scales_are_refused() {
    for (rate_hz, lsb_uv) in [(0, 1.0), (200_000, 1.0), (512, 0.0), (512, f64::NAN)] {
        let recording = open(tones(&[1.0], 4, (1, 1), 1)).expect("usable");
        let map = MontageMap::new(&recording.labels(), &["Fz"], Missing::Zero).expect("Fz");
        let error = VirtualAdc::new(recording, &map, AdcSpec { rate_hz, lsb_uv });
        let error = error.err().expect("refused");
        assert!(matches!(error, RecordingError::AdcSpec { .. }), "{error}");
    }
}
