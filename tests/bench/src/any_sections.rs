//! A contender (filter code to be measured) that runs our filters with random coefficients.

use fixed_dsp::{Cascade, CascadeState, Coefficient, Filter, Section};
use model::{ELECTRODES, SECTIONS};

use crate::{
    block::{Block, SILENCE},
    contenders::Contender,
    random::Random,
};

/// A cascade whose sections change randomly before every block, while its states persist.
///
/// Poles can be anywhere and sums wrap, so the output is not a filtered signal. The contender shows
/// that the microcontroller and the PC compute equal bits for any coefficient and any sample.
#[derive(Clone, Debug)]
pub struct AnySections {
    random: Random,
    cascade: Cascade<SECTIONS>,
    states: [CascadeState<SECTIONS>; ELECTRODES],
    block: Block,
}

impl Default for AnySections {
    /// Draws sections from a fixed seed, so that all inputs pass through the same ones.
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
    /// Draws a coefficient: any fraction, and an integer part from -2 to 2, which is the range of
    /// stable sections.
    fn coefficient(&mut self) -> Coefficient {
        Coefficient {
            integer: (self.next() % 5).cast_signed() - 2,
            fraction: self.next().cast_signed(),
        }
    }

    fn section(&mut self) -> Section {
        let [gain, a1, a2] = core::array::from_fn(|_| self.coefficient());
        match self.next() >> 30 {
            0 => Section::Notch {
                a1,
                one_minus_b0: a2,
            },
            1 => Section::HighPass { a1, a2 },
            2 => Section::BandPass { gain, a1, a2 },
            _ => Section::LowPass { gain, a1, a2 },
        }
    }

    fn cascade(&mut self) -> Cascade<SECTIONS> {
        Cascade {
            sections: core::array::from_fn(|_| self.section()),
        }
    }
}
