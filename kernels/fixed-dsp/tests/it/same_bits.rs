//! Tests that filtering in blocks, by single samples and with compiled coefficients all return the
//! same bits as the exact sum with unsplit coefficients.

use fixed_dsp::{BLOCK, Cascade, CascadeState, Coefficient, Compiled, Design, Filter, Section};
use proptest::prelude::*;

/// A cascade with sections of every type. The first high-pass has poles near DC, where `a1 - 2` and
/// `a2 + 1` have integer parts of 0; the second has poles far from DC.
struct Mixture;

impl Design<5> for Mixture {
    const CASCADE: Cascade<5> = Cascade {
        sections: [
            Section::Notch {
                a1: Coefficient::nearest(1.618_616_208),
                one_minus_b0: Coefficient::nearest(0.010_123_365),
            },
            Section::HighPass {
                a1: Coefficient::nearest(1.990_036_109),
                a2: Coefficient::nearest(-0.990_074_359),
            },
            Section::HighPass { a1: Coefficient::nearest(-0.7), a2: Coefficient::nearest(-0.49) },
            Section::BandPass {
                gain: Coefficient::nearest(0.272_398),
                a1: Coefficient::nearest(1.443_524),
                a2: Coefficient::nearest(-0.446_945),
            },
            Section::LowPass {
                gain: Coefficient::nearest(0.107_273),
                a1: Coefficient::nearest(1.231_593),
                a2: Coefficient::nearest(-0.660_686),
            },
        ],
    };
}

/// State of one section that is computed exactly, in 128 bits, by the formulas at [`Section`].
/// `memory` is `[x1, x2, y1, y2]`; `error` is the rounding error in Q0.32.
#[derive(Clone, Copy)]
struct Exact {
    memory: [i32; 4],
    error: i128,
}

impl Exact {
    const REST: Self = Self { memory: [0; 4], error: 1 << 31 };

    fn apply(&mut self, section: &Section, x0: i32) -> i32 {
        let q = |coefficient: Coefficient| i128::from(coefficient.to_q32());
        let one = 1_i128 << 32;
        let [x1, x2, y1, y2] = self.memory.map(i128::from);
        let x = i128::from(x0);
        let sum = match *section {
            Section::Notch { a1, one_minus_b0 } => {
                (x + x2 - y2) * one + q(a1) * (y1 - x1) + q(one_minus_b0) * (2 * y2 - x - x2)
            }
            Section::HighPass { a1, a2 } => (x - 2 * x1 + x2) * one + q(a1) * y1 + q(a2) * y2,
            Section::BandPass { gain, a1, a2 } => q(gain) * (x - x2) + q(a1) * y1 + q(a2) * y2,
            Section::LowPass { gain, a1, a2 } => {
                q(gain) * (x + 2 * x1 + x2) + q(a1) * y1 + q(a2) * y2
            }
        } + self.error;
        self.error = sum.rem_euclid(one);
        let y = i32::try_from(sum.div_euclid(one)).expect("no output overflows 32 bits");
        self.memory = [x0, self.memory[0], y, self.memory[2]];
        y
    }
}

proptest! {
    #[test]
    fn every_way_to_filter_returns_the_bits_of_the_exact_sum(
        // Inputs up to half of full scale, so that no output of these sections overflows.
        input in prop::collection::vec(-(1_i32 << 27)..(1 << 27), BLOCK..400),
        channels in 1_usize..4,
    ) {
        let (known, cascade) = (Compiled::<Mixture, 5>::new(), Mixture::CASCADE);
        let mut exact = [Exact::REST; 5];
        let mut single = [CascadeState::REST; 2];
        let mut blockwise = [vec![CascadeState::REST; channels], vec![CascadeState::REST; channels]];
        for samples in input.as_chunks::<BLOCK>().0 {
            let expected = samples.map(|x| {
                let sections = cascade.sections.iter().zip(&mut exact);
                sections.fold(x, |x, (section, state)| state.apply(section, x))
            });
            prop_assert_eq!(samples.map(|x| cascade.apply(&mut single[0], x)), expected);
            prop_assert_eq!(samples.map(|x| known.apply(&mut single[1], x)), expected);
            let mut blocks = [vec![*samples; channels], vec![*samples; channels]];
            cascade.apply_blocks(&mut blockwise[0], &mut blocks[0]);
            known.apply_blocks(&mut blockwise[1], &mut blocks[1]);
            for block in blocks.iter().flatten() {
                prop_assert_eq!(*block, expected);
            }
        }
        prop_assert!(blockwise.iter().flatten().all(|state| *state == single[0]));
        prop_assert_eq!(single[0], single[1]);
    }
}
