//! Filters of the third-party crate idsp, with the coefficients of our sections.

use dsp_fixedpoint::Q32;
use dsp_process::SplitProcess;
use fixed_dsp::{Coefficient, Section};
use idsp::iir::Biquad;
use model::{ELECTRODES, MAINS_50, SECTIONS};

use crate::{
    block::{Block, SILENCE},
    contenders::Contender,
};

/// Second-order section of idsp: five coefficients in Q2.29, because the largest magnitude is 2.
pub type Section29 = Biquad<Q32<29>>;

/// Our sections for 50 Hz mains as idsp's sections, in the same order and with the same gains. `S`,
/// the type of a section's state, selects the form of idsp's filter.
#[derive(Clone, Debug)]
pub struct IdspCascade<S> {
    sections: [Section29; SECTIONS],
    states: [[S; SECTIONS]; ELECTRODES],
    block: Block,
}

impl<S: Default> Default for IdspCascade<S> {
    fn default() -> Self {
        Self {
            sections: MAINS_50.cascade.sections.map(|section| biquad(&section)),
            states: core::array::from_fn(|_| core::array::from_fn(|_| S::default())),
            block: SILENCE,
        }
    }
}

impl<S> IdspCascade<S>
where
    Section29: SplitProcess<i32, i32, S>,
{
    /// Filters one sample of one electrode; input and output are in Q27.5.
    ///
    /// # Panics
    /// If `electrode` is not below [`ELECTRODES`].
    #[inline]
    pub fn apply(&mut self, electrode: usize, x: i32) -> i32 {
        let sections = self.sections.iter().zip(&mut self.states[electrode]);
        sections.fold(x, |x, (section, state)| section.process(state, x))
    }
}

impl<S> Contender for IdspCascade<S>
where
    Section29: SplitProcess<i32, i32, S>,
{
    fn load(&mut self, block: &Block) {
        self.block = *block;
    }

    /// Applies each section to all four samples before the next section, as idsp itself does. This
    /// is faster than sample by sample.
    fn run(&mut self) {
        for (states, samples) in self.states.iter_mut().zip(&mut self.block) {
            for (section, state) in self.sections.iter().zip(states) {
                for sample in &mut *samples {
                    *sample = section.process(state, *sample);
                }
            }
        }
    }

    fn output(&self) -> Block {
        self.block
    }
}

/// Converts one of our sections to idsp's direct form: `b0, b1, b2, -a1, -a2`, rounded to Q2.29.
fn biquad(section: &Section) -> Section29 {
    const ONE: i64 = 1 << 32;
    let q32 = Coefficient::to_q32;
    let q32 = match *section {
        Section::Notch { a1, one_minus_b0 } => {
            let [a1, gain] = [q32(a1), ONE - q32(one_minus_b0)];
            [gain, -a1, gain, a1, ONE - 2 * gain]
        }
        Section::HighPass { a1, a2 } => [ONE, -2 * ONE, ONE, q32(a1), q32(a2)],
        Section::BandPass { gain, a1, a2 } => [q32(gain), 0, -q32(gain), q32(a1), q32(a2)],
        Section::LowPass { gain, a1, a2 } => {
            let gain = q32(gain);
            [gain, 2 * gain, gain, q32(a1), q32(a2)]
        }
    };
    #[expect(clippy::cast_possible_truncation, reason = "|coefficient| <= 2, Q2.29")]
    let rounded = |q32: i64| Q32::from_bits(((q32 + 4) >> 3) as i32);
    Biquad { ba: q32.map(rounded) }
}
