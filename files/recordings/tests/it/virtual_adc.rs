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

/// Limit of the error, uV: rounding by half a count of 22.35 nV, plus 0.01 nV for the resampler.
/// The largest error measured in these tests is 0.011125 uV, less than the half count alone.
const HALF_COUNT_UV: f64 = 0.011_175_9 + 1e-5;

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn seconds(sample: usize, rate: f64) -> f64 {
    sample as f64 / rate
}

/// Builds a file of `records` records of 1 s that holds a sine of 100 uV at `hz` Hz on an offset of
/// 20 mV.
fn sine_file(hz: f64, rate: u32, records: usize) -> Vec<u8> {
    let samples = (0..records * rate as usize)
        .map(|k| 20_000.0 + 100.0 * (TAU * hz * seconds(k, rate.into())).sin());
    let data = samples.flat_map(f64::to_le_bytes).collect();
    let signal = GdfSignal::with_type(17, rate, data);
    GdfFile::version_2(i64::try_from(records).expect("small"), vec![signal]).bytes()
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

/// Returns the largest deviation from the exact sine, uV, at least `edge` s away from both ends.
fn worst_error_uv(counts: &[[i32; 64]], hz: f64, edge: f64) -> f64 {
    let end = seconds(counts.len(), 512.0) - edge;
    let inside = counts
        .iter()
        .enumerate()
        .map(|(k, c)| (seconds(k, 512.0), c[0]));
    inside
        .filter(|(t, _)| (edge..end).contains(t))
        .map(|(t, count)| {
            let analytic = 20_000.0 + 100.0 * (TAU * hz * t).sin();
            (f64::from(count) * ADS1299.lsb_uv - analytic).abs()
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_resampled_sine_equals_the_analytic_sine_at_k_over_rate() {
    // 40 s at 160 Hz need six transforms, so boundaries between transforms are tested too. The
    // first and last 3.3 s are not, because they depend on the values assumed beyond the signal.
    for hz in [1.0, 10.0, 60.0] {
        let (counts, counters) = play_cz(sine_file(hz, 160, 40));
        assert_eq!(counts.len(), 40 * 512);
        let error = worst_error_uv(&counts, hz, 3.3);
        assert!(error < HALF_COUNT_UV, "{hz} Hz: {error} uV");
        assert_eq!(counters, AdcCounters::default());
    }
}

#[test]
fn downsampling_and_odd_ratios_have_no_time_shift() {
    for rate in [128, 250, 1000, 2048] {
        let (counts, _) = play_cz(sine_file(10.0, rate, 24));
        let edge = 600.0 / f64::from(rate.min(512)) + 0.1;
        let error = worst_error_uv(&counts, 10.0, edge);
        assert!(error < HALF_COUNT_UV, "{rate} Hz: {error} uV");
    }
}

#[test]
fn an_offset_does_not_ring_at_the_ends() {
    let (counts, _) = play_cz(sine_file(0.0, 160, 10));
    let error = worst_error_uv(&counts, 0.0, 0.0);
    assert!(error < HALF_COUNT_UV, "{error} uV of 20 mV");
}

#[test]
fn frequencies_above_the_lower_nyquist_are_not_aliased() {
    let (counts, _) = play_cz(sine_file(300.0, 2048, 8));
    let inside = &counts[512..counts.len() - 512];
    let largest = inside
        .iter()
        .map(|c| (f64::from(c[0]) * ADS1299.lsb_uv - 20_000.0).abs());
    let largest = largest.fold(0.0, f64::max);
    assert!(largest < HALF_COUNT_UV, "300 Hz leaves {largest} uV");
}

#[test]
fn samples_at_the_rate_of_the_adc_are_only_rounded_to_nearest() {
    let samples: Vec<f32> = (0_u16..1024).map(|k| f32::from(k) * 0.37 - 190.0).collect();
    let file = GdfFile::float32(2, 512, &samples);
    let (counts, _) = play_cz(file.bytes());
    for (count, sample) in counts.iter().zip(&samples) {
        let exact = f64::from(*sample) / ADS1299.lsb_uv;
        assert!((f64::from(count[0]) - exact).abs() <= 0.5 + 1e-9);
        assert!(count[1..].iter().all(|&unused| unused == 0));
    }
}

#[test]
fn saturated_and_non_finite_samples_are_counted() {
    let samples = [
        f32::NAN,
        1e6,
        -1e6,
        f32::INFINITY,
        5.0,
        f32::NAN,
        187_500.0,
        -187_500.0,
    ];
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
    for (code, unit, value) in [
        (4256, "V", 1e-3),
        (4274, "mV", 1.0),
        (0, "uV", 1000.0),
        (4276, "", 1e6),
    ] {
        let mut file = GdfFile::float32(1, 512, &[value; 512]);
        (file.signals[0].unit_code, file.signals[0].unit) = (code, unit);
        let (counts, _) = play_cz(file.bytes());
        // 1 mV is 1 mV / 22.351741790771484 nV = 44739.24 counts.
        assert_eq!(counts[7][0], 44_739, "{unit} {code}");
    }
}

#[test]
fn a_flat_recording_changes_by_one_count_in_every_second_sample() {
    let file = GdfFile::float32(1, 512, &[100.0; 512]);
    let recording = open(file.bytes()).expect("a valid file");
    let adc = played(recording, &["Cz"], Missing::Refuse);
    for (sample, counts) in adc.enumerate() {
        let counts = counts.expect("readable");
        assert_eq!(counts[0], 4474 + i32::from(sample % 2 == 1));
        assert!(counts[1..].iter().all(|&unused| unused == 0));
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
        // Cz and Pz are as far from C3 as from C4, so each is the mean of these two: 150 uV.
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
        let file = EdfFile {
            duration,
            ..EdfFile::edf("-1", vec![signal])
        };
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
fn a_ratio_of_rates_with_large_terms_is_approximated_with_a_warning_or_refused() {
    let adc = |length_s, per_record| {
        let mut file = GdfFile::float32(1, per_record, &vec![1.0; per_record as usize]);
        (file.version, file.length_s) = ("2.51", length_s);
        let recording = open(file.bytes()).expect("usable");
        let map = MontageMap::new(&recording.labels(), &["Cz"], Missing::Zero).expect("Cz");
        VirtualAdc::new(recording, &map, ADS1299)
    };
    let exact = adc(0.5, 125).expect("250 Hz");
    assert_eq!(exact.recording().warnings(), []);
    let near = adc(0.987_650_001, 256).expect("within 1 ppm");
    let [Warning::RateApproximated { ppm, .. }] = near.recording().warnings() else {
        panic!("{:?}", near.recording().warnings());
    };
    assert!(*ppm != 0.0 && ppm.abs() <= 1.0, "{ppm}");
    for (length_s, per_record) in [(1e7, 1), (0.999_987_654, 512)] {
        let error = adc(length_s, per_record).err().expect("refused");
        assert!(
            error.to_string().contains("resample the recording"),
            "{error}"
        );
    }
}

#[test]
fn impossible_scales_are_refused() {
    for (rate_hz, lsb_uv) in [(0, 1.0), (200_000, 1.0), (512, 0.0), (512, f64::NAN)] {
        let recording = open(sine_file(1.0, 4, 1)).expect("usable");
        let map = MontageMap::new(&recording.labels(), &["Cz"], Missing::Zero).expect("Cz");
        let error = VirtualAdc::new(recording, &map, AdcSpec { rate_hz, lsb_uv });
        let error = error.err().expect("refused");
        assert!(matches!(error, RecordingError::AdcSpec { .. }), "{error}");
    }
}
