//! Tests that sections of every type follow their difference equations in f64, and that a
//! coefficient split into integer and fraction equals the unsplit coefficient.

use fixed_dsp::{Cascade, CascadeState, Coefficient, Filter, Section};
use proptest::prelude::*;

fn value(coefficient: Coefficient) -> f64 {
    f64::from(coefficient.integer) + f64::from(coefficient.fraction) / 4_294_967_296.0
}

/// Draws stable sections of every type, with poles at a random radius and angle.
fn section() -> impl Strategy<Value = Section> {
    (0..4, 0.1..0.95_f64, 0.1..3.0_f64, 0.05..1.0_f64).prop_map(|(shape, radius, angle, gain)| {
        let a1 = Coefficient::nearest(2.0 * radius * angle.cos());
        let a2 = Coefficient::nearest(-radius * radius);
        let gain = Coefficient::nearest(gain);
        match shape {
            0 => Section::Notch {
                a1: Coefficient::nearest((1.0 + radius * radius) * angle.cos()),
                one_minus_b0: Coefficient::nearest((1.0 - radius * radius) / 2.0),
            },
            1 => Section::HighPass { a1, a2 },
            2 => Section::BandPass { gain, a1, a2 },
            _ => Section::LowPass { gain, a1, a2 },
        }
    })
}

/// Returns `[b0, b1, b2]` and `[a1, a2]` of the section's transfer function with the denominator
/// `1 - a1 z^-1 - a2 z^-2`.
fn polynomials(section: &Section) -> ([f64; 3], [f64; 2]) {
    match *section {
        Section::Notch { a1, one_minus_b0 } => {
            let (a1, b0) = (value(a1), 1.0 - value(one_minus_b0));
            ([b0, -a1, b0], [a1, 1.0 - 2.0 * b0])
        }
        Section::HighPass { a1, a2 } => ([1.0, -2.0, 1.0], [value(a1), value(a2)]),
        Section::BandPass { gain, a1, a2 } => {
            ([value(gain), 0.0, -value(gain)], [value(a1), value(a2)])
        }
        Section::LowPass { gain, a1, a2 } => {
            ([value(gain), 2.0 * value(gain), value(gain)], [value(a1), value(a2)])
        }
    }
}

/// Returns the distance of the section's outermost pole from the origin.
fn outer_pole(section: &Section) -> f64 {
    let [a1, a2] = polynomials(section).1;
    let discriminant = a1 * a1 / 4.0 + a2;
    if discriminant < 0.0 { (-a2).sqrt() } else { a1.abs() / 2.0 + discriminant.sqrt() }
}

/// Filters `input` with the section's difference equation, computed in f64.
fn twin(section: &Section, input: &[i32]) -> Vec<f64> {
    let ([b0, b1, b2], [a1, a2]) = polynomials(section);
    let (mut x1, mut x2, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0);
    input
        .iter()
        .map(|&x| {
            let x = f64::from(x);
            let y = b0 * x + b1 * x1 + b2 * x2 + a1 * y1 + a2 * y2;
            (x2, x1, y2, y1) = (x1, x, y1, y);
            y
        })
        .collect()
}

proptest! {
    #[test]
    fn a_section_follows_its_difference_equation(
        section in section(),
        input in prop::collection::vec(-1_000_000..1_000_000, 1..300),
    ) {
        let cascade = Cascade { sections: [section] };
        let mut state = CascadeState::REST;
        for (&x, expected) in input.iter().zip(twin(&section, &input)) {
            let y = f64::from(cascade.apply(&mut state, x));
            // The rounding error e, in [0, 1), enters as a difference e[n] - e[n-1] and is filtered
            // by `1 / A`, whose L1 norm is at most 1 / (1 - outer pole)^2. The limit is twice that
            // norm.
            let bound = 2.0 / (1.0 - outer_pole(&section)).powi(2);
            prop_assert!((y - expected).abs() < bound, "{} instead of {}", y, expected);
        }
    }

    #[test]
    fn splitting_a_coefficient_into_integer_and_fraction_is_exact(q32 in -(1_i64 << 40)..(1_i64 << 40)) {
        let coefficient = Coefficient::from_q32(q32);
        prop_assert_eq!(coefficient.to_q32(), q32);
        prop_assert!((value(coefficient) - f64::from(coefficient.integer)).abs() <= 0.5);
    }
}

#[test]
fn a_notch_passes_a_constant_unchanged() {
    // Coefficients from scipy's `iirnotch(50, 30, fs=512)`.
    let notch = Section::Notch {
        a1: Coefficient::nearest(1.618_616_208),
        one_minus_b0: Coefficient::nearest(1.0 - 0.989_876_635),
    };
    let cascade = Cascade { sections: [notch] };
    let mut state = CascadeState::REST;
    let last = (0..5_000).map(|_| cascade.apply(&mut state, 100_000_000)).last();
    assert!(last.is_some_and(|y| (y - 100_000_000).abs() <= 1), "{last:?}");
}
