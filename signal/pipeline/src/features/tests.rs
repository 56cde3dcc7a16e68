//! Compares features with the same computation in f64, and tests which filters are refused.

use std::vec::Vec;

use model::{GUARD_BITS, LSB_NV};

use super::*;

/// `butter(2, [8, 30], 'bandpass', fs=128)` of scipy 1.15 as two sections, each with the square
/// root of the gain 0.1628.
const BAND: [[f64; 3]; 2] = [
    [0.403_467_658_652_6, 1.493_075_431_284_8, -0.653_316_093_047_3],
    [0.403_467_658_652_6, 0.299_224_745_896_6, -0.354_837_442_314_6],
];

#[expect(clippy::cast_possible_truncation, reason = "coefficients below 2")]
fn q32(coefficients: [[f64; 3]; 2]) -> [[i64; 3]; 2] {
    coefficients.map(|section| section.map(|x| (x * 4_294_967_296.0).round() as i64))
}

/// Weights of two filters: a difference of two electrodes, and a sum over all electrodes with
/// weights of both signs.
fn rows() -> [[i8; ELECTRODES]; 2] {
    let mut difference = [0; ELECTRODES];
    (difference[0], difference[ELECTRODES - 1]) = (127, -127);
    let mean = core::array::from_fn(|e| if e % 3 == 0 { 40 } else { -11 });
    [difference, mean]
}

fn bytes(rows: &[[i8; ELECTRODES]]) -> Vec<u8> {
    let weights = rows.as_flattened().iter();
    weights.map(|weight| weight.cast_unsigned()).collect()
}

fn filters() -> FeatureFilters {
    FeatureFilters::new(7, q32(BAND), &bytes(&rows())).expect("filters in range")
}

/// Microvolts of an electrode: a 10 Hz wave that moves over the head, and slow waves below the
/// band.
#[expect(clippy::cast_precision_loss, reason = "some thousands")]
fn microvolts(electrode: usize, n: usize) -> f64 {
    let (phase, t) = (electrode as f64 / 9.0, n as f64 / 128.0);
    let alpha = (core::f64::consts::TAU * 10.0 * t + phase).sin();
    let slow = (core::f64::consts::TAU * 1.0 * t + 2.0 * phase).sin();
    40.0 * alpha * (1.5 + (0.7 * t).sin()) + 60.0 * slow
}

#[expect(clippy::cast_possible_truncation, reason = "below 100 uV")]
fn step(n: usize) -> Step {
    let per_uv = 1_000.0 / f64::from(LSB_NV) * f64::from(1_u32 << GUARD_BITS);
    Step {
        electrodes: core::array::from_fn(|e| (microvolts(e, n) * per_uv).round() as i32),
        ..Step::SILENCE
    }
}

/// Returns the levels of every hop, computed in f64.
fn expected(steps: usize) -> Vec<[f64; 2]> {
    let mut signals = rows().map(|row| {
        let sample = |n| {
            let terms = row.iter().enumerate();
            terms.map(|(e, w)| f64::from(*w) * 4.0 * microvolts(e, n)).sum()
        };
        (0..steps).map(sample).collect::<Vec<f64>>()
    });
    for signal in &mut signals {
        for [gain, a1, a2] in BAND {
            let (mut x1, mut x2, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0);
            for x in signal.iter_mut() {
                let y = gain * (*x - x2) + a1 * y1 + a2 * y2;
                (x2, x1, y2, y1) = (x1, *x, y1, y);
                *x = y;
            }
        }
    }
    let hop = |k: usize| {
        let energy = |signal: &Vec<f64>| signal[k * HOP..(k + 1) * HOP].iter().map(|y| y * y).sum();
        [0, 1].map(|s| 8.0 * f64::log2(energy(&signals[s])) - 80.0)
    };
    (0..steps / HOP).map(hop).collect()
}

#[test]
fn levels_are_those_of_the_same_computation_in_f64() {
    let mut extractor = FeatureExtractor::NEW;
    extractor.set_filters(filters());
    let steps = 600 * HOP;
    let made: Vec<_> = (0..steps).filter_map(|n| extractor.add_step(&step(n))).collect();
    let expected = expected(steps);
    assert_eq!(made.len(), expected.len());
    for (hop, (features, expected)) in made.iter().zip(&expected).enumerate() {
        assert_eq!(features.hop as usize, hop);
        assert_eq!((features.id, features.levels().len()), (7, 2));
        assert_eq!(features.settling, hop < usize::from(SETTLING_HOPS));
        // Rounding to a level causes an error of up to 0.5; the rest of the permitted error comes
        // from rounding the electrodes to quarters of a microvolt.
        for (level, exact) in features.levels().iter().zip(expected) {
            let error = f64::from(*level) - exact;
            assert!(error.abs() < 0.9, "hop {hop}: {error}");
        }
    }
    // The levels follow the signal: the amplitude of the alpha wave varies by more than a factor of
    // 2, which is 16 levels.
    let levels = made.iter().skip(20).map(|features| features.levels()[1]);
    let range = [levels.clone().min(), levels.max()].map(Option::unwrap);
    assert!(range[1] - range[0] > 16, "{range:?}");
}

#[test]
fn without_filters_there_are_no_features_and_the_hops_count_on() {
    let mut extractor = FeatureExtractor::NEW;
    assert!((0..3 * HOP).all(|n| extractor.add_step(&step(n)).is_none()));
    extractor.set_filters(filters());
    let made = (0..HOP).find_map(|n| extractor.add_step(&step(n)));
    assert_eq!(made.map(|features| (features.hop, features.settling)), Some((3, true)));
    extractor.restart();
    let made = (0..HOP).find_map(|n| extractor.add_step(&step(n)));
    assert_eq!(made.map(|features| features.hop), Some(0));
}

/// After a restart, the same steps yield the same features as in the first run.
#[test]
fn a_restart_forgets_the_run_before() {
    let run = |extractor: &mut FeatureExtractor| -> Vec<_> {
        (0..40 * HOP).filter_map(|n| extractor.add_step(&step(n))).collect()
    };
    let mut extractor = FeatureExtractor::NEW;
    extractor.set_filters(filters());
    let first = run(&mut extractor);
    extractor.add_step(&Step { saturated: 1, settling: true, ..step(3) });
    extractor.restart();
    assert_eq!(run(&mut extractor), first);
}

#[test]
fn filters_out_of_range_are_refused_and_the_largest_ones_neither_panic_nor_overflow() {
    let [row, _] = rows();
    let with = |weights: &[(usize, i8)]| {
        let mut row = row;
        for (at, weight) in weights {
            row[*at] = *weight;
        }
        FeatureFilters::new(1, q32(BAND), &bytes(&[row])).is_some()
    };
    let full: Vec<_> = (0..14).map(|at| (at + 1, 127)).collect();
    assert!(with(&full));
    assert!(!with(&[&full[..], &[(20, 127)]].concat()), "a sum above 2,047");
    assert!(!with(&[(3, i8::MIN)]));
    let rows = |count| bytes(&std::vec![row; count]);
    assert!(FeatureFilters::new(1, q32(BAND), &[]).is_none());
    assert!(FeatureFilters::new(1, q32(BAND), &rows(9)).is_none());
    assert!(FeatureFilters::new(1, q32(BAND), &rows(1)[1..]).is_none());
    assert!(FeatureFilters::new(1, [[0, (1 << 34) + 1, 0]; 2], &rows(1)).is_none());
    // With an unstable band-pass, values wrap, but every hop still has all its levels.
    let hostile = FeatureFilters::new(1, [[1 << 34, -(1 << 34), 1 << 34]; 2], &rows(8));
    let mut extractor = FeatureExtractor::NEW;
    extractor.set_filters(hostile.expect("in range"));
    let loud = |n: usize| Step {
        electrodes: [if n.is_multiple_of(2) { i32::MAX } else { i32::MIN }; ELECTRODES],
        ..Step::SILENCE
    };
    let made = (0..100 * HOP).filter_map(|n| extractor.add_step(&loud(n)));
    assert_eq!(made.map(|features| features.levels().len()).sum::<usize>(), 800);
}
