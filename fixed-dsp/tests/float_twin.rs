//! Sections of every shape against the same difference equations in f64, and the split
//! multiplication against the exact one.

use fixed_dsp::{Cascade, CascadeState, Coefficient, Section, Shape};
use proptest::prelude::*;

fn value(coefficient: Coefficient) -> f64 {
    f64::from(coefficient.integer) + f64::from(coefficient.remainder) / 4_294_967_296.0
}

/// A stable section with poles at `radius` and `angle`, of any shape.
fn section() -> impl Strategy<Value = Section> {
    let shape = prop_oneof![
        Just(Shape::Notch),
        Just(Shape::HighPass),
        Just(Shape::BandPass),
        Just(Shape::LowPass),
    ];
    (shape, 0.1..0.95_f64, 0.1..3.0_f64, 0.05..1.0_f64).prop_map(|(shape, radius, angle, gain)| {
        let a1 = -2.0 * radius * angle.cos();
        Section {
            shape,
            gain: Coefficient::nearest(gain),
            // The notch's `first` multiplies x1 - y1: it is a1, not -a1.
            first: Coefficient::nearest(if shape == Shape::Notch { a1 } else { -a1 }),
            second: Coefficient::nearest(-radius * radius),
        }
    })
}

/// The shape's formula in f64, from its documentation.
fn twin(section: &Section, input: &[i32]) -> Vec<f64> {
    let (gain, first, second) = (
        value(section.gain),
        value(section.first),
        value(section.second),
    );
    let (mut x1, mut x2, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0);
    input
        .iter()
        .map(|&x| {
            let x = f64::from(x);
            let y = match section.shape {
                Shape::Notch => gain * (x + x2) + first * (x1 - y1) + second * y2,
                Shape::HighPass => gain * (x - 2.0 * x1 + x2) + first * y1 + second * y2,
                Shape::BandPass => gain * (x - x2) + first * y1 + second * y2,
                Shape::LowPass => gain * (x + 2.0 * x1 + x2) + first * y1 + second * y2,
            };
            (x2, x1, y2, y1) = (x1, x, y1, y);
            y
        })
        .collect()
}

proptest! {
    #[test]
    fn a_section_follows_its_formula(
        section in section(),
        input in prop::collection::vec(-1_000_000..1_000_000, 1..300),
    ) {
        let cascade = Cascade { sections: [section] };
        let mut state = CascadeState::default();
        for (&x, expected) in input.iter().zip(twin(&section, &input)) {
            let y = f64::from(cascade.step(&mut state, x));
            // An error in [0, 1) enters as a difference and passes 1 / A, whose L1 norm is at most
            // 1 / (1 - radius)^2.
            let radius = (-value(section.second)).sqrt();
            let bound = 2.0 / (1.0 - radius).powi(2);
            prop_assert!((y - expected).abs() < bound, "{} instead of {}", y, expected);
        }
    }

    #[test]
    fn two_sections_in_series_are_one_after_the_other(
        first in section(),
        second in section(),
        input in prop::collection::vec(-100_000..100_000, 1..100),
    ) {
        let (one, two) = (Cascade { sections: [first] }, Cascade { sections: [second] });
        let both = Cascade { sections: [first, second] };
        let mut states = (CascadeState::default(), CascadeState::default());
        let mut state = CascadeState::default();
        for x in input {
            let between = one.step(&mut states.0, x);
            prop_assert_eq!(both.step(&mut state, x), two.step(&mut states.1, between));
        }
    }

    #[test]
    fn splitting_a_coefficient_loses_nothing(q32 in -(1_i64 << 40)..(1_i64 << 40)) {
        let coefficient = Coefficient::from_q32(q32);
        prop_assert_eq!(coefficient.to_q32(), q32);
        prop_assert!((value(coefficient) - f64::from(coefficient.integer)).abs() <= 0.5);
    }
}

#[test]
fn a_notch_whose_second_is_1_minus_2_gain_passes_a_constant_unchanged() {
    let gain = Coefficient::nearest(0.989_876_635);
    let notch = Section {
        shape: Shape::Notch,
        gain,
        first: Coefficient::nearest(-1.618_616_208),
        second: Coefficient::from_q32((1 << 32) - 2 * gain.to_q32()),
    };
    let cascade = Cascade { sections: [notch] };
    let mut state = CascadeState::default();
    let last = (0..5_000)
        .map(|_| cascade.step(&mut state, 100_000_000))
        .last();
    assert!(
        last.is_some_and(|y| (y - 100_000_000).abs() <= 1),
        "{last:?}"
    );
}
