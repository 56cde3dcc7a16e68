//! A contender (filter code to be measured) that runs our filters with random coefficients.

use fixed_dsp::{Cascade, CascadeState, Coefficient, Filter, Section};
use model::{ELECTRODES, SECTIONS};

use crate::{
    block::{Block, SILENCE},
    contenders::Contender,
    random::Random,
};

/// A cascade whose sections change randomly before every block, while its states persist. Poles can
/// be anywhere and sums wrap, so the output is no filtered signal. The comparison of the outputs
/// checks that microcontroller and PC compute equal bits for any coefficient and any sample.
#[derive(Clone, Debug)]
pub struct AnySections {
    random: Random,
    cascade: Cascade<SECTIONS>,
    states: [CascadeState<SECTIONS>; ELECTRODES],
    block: Block,
}

impl Default for AnySections {
    /// Draws sections from a fixed seed, so that every input passes through the same sections.
    fn default() -> Self {
        let mut random = Random(1);
        Self {
            cascade: random.cascade(),
            random,
            states: [CascadeState::REST; ELECTRODES],
            block: SILENCE,
        }
    }
}

impl Contender for AnySections {
    fn load(&mut self, block: &Block) {
        self.cascade = self.random.cascade();
        self.block = *block;
    }

    fn run(&mut self) {
        self.cascade.apply_blocks(&mut self.states, &mut self.block);
    }

    fn output(&self) -> Block {
        self.block
    }
}

impl Random {
    /// Draws a coefficient: any fraction, and an integer part from -2 to 2, the range of stable
    /// sections.
    fn coefficient(&mut self) -> Coefficient {
        Coefficient {
            integer: (self.next() % 5).cast_signed() - 2,
            fraction: self.next().cast_signed(),
        }
    }

    fn section(&mut self) -> Section {
        let [gain, a1, a2] = core::array::from_fn(|_| self.coefficient());
        match self.next() >> 30 {
            0 => Section::Notch { a1, one_minus_b0: a2 },
            1 => Section::HighPass { a1, a2 },
            2 => Section::BandPass { gain, a1, a2 },
            _ => Section::LowPass { gain, a1, a2 },
        }
    }

    fn cascade(&mut self) -> Cascade<SECTIONS> {
        Cascade { sections: core::array::from_fn(|_| self.section()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_integer_and_sign_is_drawn_and_samples_reach_both_ends_of_their_range() {
        let mut contender = AnySections::default();
        let (mut shapes, mut integers) = ([0; 4], [0; 5]);
        let (mut lowest, mut highest) = ([0; 2], [0; 2]);
        let mut observe = |place: usize, value: i32| {
            lowest[place] = value.min(lowest[place]);
            highest[place] = value.max(highest[place]);
        };
        for _ in 0..crate::block::BLOCKS {
            contender.load(&[[1 << 28, -(1 << 28), 12_345, 0]; ELECTRODES]);
            for section in contender.cascade.sections {
                let (shape, coefficient) = match section {
                    Section::Notch { one_minus_b0, .. } => (0, one_minus_b0),
                    Section::HighPass { a2, .. } => (1, a2),
                    Section::BandPass { a2, .. } => (2, a2),
                    Section::LowPass { a2, .. } => (3, a2),
                };
                shapes[shape] += 1;
                integers[usize::try_from(coefficient.integer + 2).expect("-2..=2")] += 1;
                observe(0, coefficient.fraction);
            }
            contender.run();
            for sample in contender.output()[0] {
                observe(1, sample);
            }
        }
        // 256 blocks have 1,536 sections: on average 384 of each shape (standard deviation 17) and
        // 307 of each integer part (standard deviation 16). Both limits are about five standard
        // deviations below the average.
        assert!(shapes.iter().all(|times| *times > 300), "{shapes:?}");
        assert!(integers.iter().all(|times| *times > 220), "{integers:?}");
        // The smallest and the largest of at least 1,024 random values are within 1 % of the ends
        // of the range.
        assert!(lowest.iter().all(|value| *value < i32::MIN / 100 * 99));
        assert!(highest.iter().all(|value| *value > i32::MAX / 100 * 99));
    }
}
