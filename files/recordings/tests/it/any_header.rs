//! Tests that files with any legal header yield the values that the header defines. The expected
//! values are computed in integers.

use proptest::{collection::vec, prelude::*};
use recordings::{RecordingError, SampleType, Warning};

use crate::{
    files::{EdfFile, EdfSignal, GdfFile, GdfSignal},
    open, read_all,
};

/// The sample types: GDF's type numbers, and for EDF and BDF two numbers that GDF does not use.
const EDF: u32 = 0;
const BDF: u32 = 99;
const GDF: [u32; 14] = [1, 2, 3, 4, 5, 6, 7, 8, 16, 17, 279, 535, 255 + 40, 511 + 56];

/// A signal of one sample. A digital limit is `digital * 2^wide * 2^unit`, and the sample is
/// `sample * 2^unit`, so that the sample of a float type can be 2^84 times smaller than the limits.
/// A physical limit is `physical * 2^physical_unit`.
#[derive(Debug, Clone)]
struct Case {
    store: u32,
    digital: [i128; 2],
    sample: i128,
    wide: i32,
    unit: i32,
    physical: [i128; 2],
    physical_unit: i32,
}

fn integer(least: i128, most: i128) -> impl Strategy<Value = i128> {
    prop_oneof![
        2 => least..=most,
        1 => (-300_i128..=300).prop_map(move |near| near.clamp(least, most)),
        1 => prop::sample::select(vec![least, most]),
    ]
}

fn case(stores: &'static [u32]) -> impl Strategy<Value = Case> {
    prop::sample::select(stores).prop_flat_map(|store| {
        let (least, most) = match sample_type(store) {
            SampleType::Signed(bytes) => (-1 << (8 * bytes - 1), (1 << (8 * bytes - 1)) - 1),
            SampleType::Unsigned(bytes) => (0, (1 << (8 * bytes)) - 1),
            // Integers that a float32 holds exactly.
            SampleType::Float32 | SampleType::Float64 => (1 - (1 << 24), (1 << 24) - 1),
        };
        // A float32 is below 2^128, and the limits are below 2^24 * 2^wide * 2^unit.
        let (wide, unit) = match store {
            16 => (0..=60, -100..=44),
            17 => (0..=60, -600..=800),
            _ => (0..=0, 0..=0),
        };
        let physical_unit = if is_gdf(store) { -60..=100 } else { -2..=-2 };
        // At most 9999.75, which is exact in binary and fits the 8 characters of EDF.
        let physical = || integer(-39_999, 39_999);
        let digital = || integer(least, most);
        let digital = [digital(), digital(), digital()];
        (digital, wide, unit, [physical(), physical()], physical_unit).prop_map(move |case| Case {
            store,
            digital: [case.0[0], case.0[1]],
            sample: case.0[2],
            wide: case.1,
            unit: case.2,
            physical: case.3,
            physical_unit: case.4,
        })
    })
}

fn is_gdf(store: u32) -> bool {
    !matches!(store, EDF | BDF)
}

fn sample_type(store: u32) -> SampleType {
    match store {
        EDF => SampleType::Signed(2),
        BDF => SampleType::Signed(3),
        _ => SampleType::from_gdf(store).expect("a type"),
    }
}

#[expect(clippy::cast_precision_loss, reason = "rounded once, by 2^-53")]
fn scaled(integer: i128, exponent: i32) -> f64 {
    integer as f64 * 2_f64.powi(exponent)
}

fn file(cases: &[Case]) -> Vec<u8> {
    let edf_signal = |case: &Case| {
        let physical = case.physical.map(|value| scaled(value, case.physical_unit));
        let [p_min, p_max] = physical.map(|value| value.to_string());
        let [d_min, d_max] = case.digital.map(|value| value.to_string());
        EdfSignal {
            ranges: [p_min, p_max, d_min, d_max],
            data: case.sample.to_le_bytes()[..sample_type(case.store).bytes()].to_vec(),
            ..EdfSignal::int16("Cz", 1, &[])
        }
    };
    let gdf_signal = |case: &Case| {
        let sample = scaled(case.sample, case.unit);
        #[expect(clippy::cast_possible_truncation, reason = "24 bits are exact")]
        let data = match case.store {
            16 => (sample as f32).to_le_bytes().to_vec(),
            17 => sample.to_le_bytes().to_vec(),
            _ => case.sample.to_le_bytes()[..sample_type(case.store).bytes()].to_vec(),
        };
        let digital = case.digital.map(|end| scaled(end, case.wide + case.unit));
        let physical = case.physical.map(|end| scaled(end, case.physical_unit));
        GdfSignal {
            ranges: [physical[0], physical[1], digital[0], digital[1]],
            ..GdfSignal::with_type(case.store, 1, data)
        }
    };
    let edf = |magic, sample_bytes| EdfFile {
        magic,
        sample_bytes,
        ..EdfFile::edf("1", cases.iter().map(edf_signal).collect())
    };
    match cases[0].store {
        EDF => edf(*b"0       ", 2).bytes(),
        BDF => edf(*b"\xffBIOSEMI", 3).bytes(),
        _ => GdfFile::version_2(1, cases.iter().map(gdf_signal).collect()).bytes(),
    }
}

/// Returns the value that the header defines, and a scale for its rounding error. The value is the
/// sum of two terms: the value at digital 0 (or at the end of the range nearest to 0), and the
/// difference from it. The scale is the larger magnitude of these two terms.
fn expected(case: &Case) -> (f64, f64) {
    // A GDF header and the reader round integers beyond 2^53 to the nearest float64.
    #[expect(clippy::cast_possible_truncation, reason = "rounded integers of at most 64 bits")]
    let rounded = |value: i128| scaled(value, 0) as i128;
    let [d_min, d_max] = case.digital.map(|value| rounded(value) << case.wide);
    let [p_min, p_max] = case.physical;
    let unit = scaled(1, case.physical_unit) / scaled(d_max - d_min, 0);
    let at = |digital: i128| p_min * (d_max - digital) + p_max * (digital - d_min);
    let value = at(rounded(case.sample));
    let zero = at(0.clamp(d_min.min(d_max), d_min.max(d_max)));
    let largest = scaled(zero, 0).abs().max(scaled(value - zero, 0).abs());
    (scaled(value, 0) * unit, largest * unit.abs())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4000) })]

    #[test]
    fn a_file_with_any_legal_header_yields_the_values_that_it_defines(
        cases in prop_oneof![
            1 => vec(case(&[EDF]), 1..4),
            1 => vec(case(&[BDF]), 1..4),
            4 => vec(case(&GDF), 1..4),
        ],
    ) {
        let is_usable = |case: &Case| case.digital[0] != case.digital[1];
        let opened = open(file(&cases));
        if !cases.iter().any(is_usable) {
            let refused = matches!(opened.err(), Some(RecordingError::Range { .. }));
            prop_assert!(refused, "no signal can be scaled");
            return Ok(());
        }
        let mut recording = opened.map_err(|error| TestCaseError::fail(error.to_string()))?;
        let samples = read_all(&mut recording);
        let warnings = recording.warnings();
        let unusable = warnings.iter().any(|one| matches!(one, Warning::Unusable { .. }));
        prop_assert_eq!(unusable, !cases.iter().all(is_usable));
        let empty = warnings.iter().filter(|one| matches!(one, Warning::PhysicalRangeEmpty { .. }));
        let is_flat = |case: &&Case| is_usable(case) && case.physical[0] == case.physical[1];
        prop_assert_eq!(empty.count(), cases.iter().filter(is_flat).count());
        for (case, samples) in cases.iter().zip(&samples) {
            if !is_usable(case) {
                prop_assert!(samples.is_empty());
            } else if is_flat(&case) {
                prop_assert_eq!(samples[0], scaled(case.sample, case.unit));
            } else {
                let (value, largest) = expected(case);
                let error = (samples[0] - value).abs();
                // The limit allows a few roundings of 2^-53 each; a step of a float32 would be
                // 2^-23 of the value.
                prop_assert!(error <= largest * 2_f64.powi(-49), "{} for {}", samples[0], value);
            }
        }
    }
}

#[test]
fn a_range_as_wide_as_the_type_loses_no_sample() {
    let float = f64::from(f32::MAX);
    let integer = 2_f64.powi(63);
    let int64 = [20_i64, -3].map(i64::to_le_bytes).concat();
    let float32 = [20.0_f32, -3.0].map(f32::to_le_bytes).concat();
    let float64 = [20.0_f64, -3.0].map(f64::to_le_bytes).concat();
    for (type_number, data, ranges) in [
        (16, &float32, [-float, float, -float, float]),
        (16, &float32, [-3.402_82e38, 3.402_823e38, -float, float]),
        (16, &float32, [-3.4e38, 3.4e38, -float, 3.39e38]),
        (17, &float64, [-float, float, -float, float]),
        (17, &float64, [-f64::MAX, f64::MAX, -f64::MAX, f64::MAX]),
        (17, &float64, [-1.7976e308, f64::MAX, -f64::MAX, 1.7976e308]),
        (7, &int64, [-integer, integer, -integer, integer]),
        (7, &int64, [-integer, integer - 1024.0, -integer, integer - 1024.0]),
    ] {
        let mut signal = GdfSignal::with_type(type_number, 2, data.clone());
        signal.ranges = ranges;
        let file = GdfFile::version_2(1, vec![signal]);
        let mut recording = open(file.bytes()).expect("a finite range");
        let samples = read_all(&mut recording);
        assert_eq!(samples[0], [20.0, -3.0], "type {type_number}, {ranges:?}");
        assert_eq!(recording.warnings(), []);
    }
}
