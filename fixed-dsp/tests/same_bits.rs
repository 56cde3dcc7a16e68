//! Blocks, single samples, and filters known at compile time give the same bits; the literal sum of
//! 64 bits, with the coefficients in one piece, says which.

use fixed_dsp::{BLOCK, Cascade, CascadeState, Coefficient, Compiled, Design, Filter, Section};
use proptest::prelude::*;

/// Sections of every shape; a pole near DC, so that integers vanish, and one far from it.
struct Mixture;

impl Design<5> for Mixture {
    const CASCADE: Cascade<5> = Cascade {
        sections: [
            Section::Notch {
                turn: Coefficient::nearest(1.618_616_208),
                loss: Coefficient::nearest(0.010_123_365),
            },
            Section::HighPass {
                first: Coefficient::nearest(1.990_036_109),
                second: Coefficient::nearest(-0.990_074_359),
            },
            Section::HighPass {
                first: Coefficient::nearest(-0.7),
                second: Coefficient::nearest(-0.49),
            },
            Section::BandPass {
                gain: Coefficient::nearest(0.272_398),
                first: Coefficient::nearest(1.443_524),
                second: Coefficient::nearest(-0.446_945),
            },
            Section::LowPass {
                gain: Coefficient::nearest(0.107_273),
                first: Coefficient::nearest(1.231_593),
                second: Coefficient::nearest(-0.660_686),
            },
        ],
    };
}

/// One section as its documentation has it, exact in 128 bits: `[x1, x2, y1, y2]` and the error.
#[derive(Clone, Copy)]
struct Exact {
    memory: [i32; 4],
    error: i128,
}

impl Exact {
    const REST: Self = Self {
        memory: [0; 4],
        error: 1 << 31,
    };

    fn step(&mut self, section: &Section, x0: i32) -> i32 {
        let q = |coefficient: Coefficient| i128::from(coefficient.to_q32());
        let one = 1_i128 << 32;
        let [x1, x2, y1, y2] = self.memory.map(i128::from);
        let x = i128::from(x0);
        let sum = match *section {
            Section::Notch { turn, loss } => {
                (x + x2 - y2) * one + q(turn) * (y1 - x1) + q(loss) * (2 * y2 - x - x2)
            }
            Section::HighPass { first, second } => {
                (x - 2 * x1 + x2) * one + q(first) * y1 + q(second) * y2
            }
            Section::BandPass {
                gain,
                first,
                second,
            } => q(gain) * (x - x2) + q(first) * y1 + q(second) * y2,
            Section::LowPass {
                gain,
                first,
                second,
            } => q(gain) * (x + 2 * x1 + x2) + q(first) * y1 + q(second) * y2,
        } + self.error;
        self.error = sum.rem_euclid(one);
        let y = i32::try_from(sum.div_euclid(one)).expect("the input has head room");
        self.memory = [x0, self.memory[0], y, self.memory[2]];
        y
    }
}

proptest! {
    #[test]
    fn every_way_to_filter_gives_the_bits_of_the_exact_sum(
        // Half of the device's full scale: nobody proved that these sections have room for more.
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
                sections.fold(x, |x, (section, state)| state.step(section, x))
            });
            prop_assert_eq!(samples.map(|x| cascade.step(&mut single[0], x)), expected);
            prop_assert_eq!(samples.map(|x| known.step(&mut single[1], x)), expected);
            let mut blocks = [vec![*samples; channels], vec![*samples; channels]];
            cascade.blocks(&mut blockwise[0], &mut blocks[0]);
            known.blocks(&mut blockwise[1], &mut blocks[1]);
            for block in blocks.iter().flatten() {
                prop_assert_eq!(*block, expected);
            }
        }
        prop_assert!(blockwise.iter().flatten().all(|state| *state == single[0]));
        prop_assert_eq!(single[0], single[1]);
    }
}
