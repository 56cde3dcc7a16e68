//! A filter that consists of second-order sections in series.

use crate::section::{Fractions, Section, SectionState};

/// Coefficients of `N` sections in series, at most [`MAX_SECTIONS`], which all channels share.
///
/// Overflow wraps. No overflow occurs if, for each section's output and for each number that a
/// section multiplies, the L1 norm of the impulse response from the cascade's input to this number,
/// times the largest input, is below 2^31. model-gen proves this for the cascades that it
/// generates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cascade<const N: usize> {
    /// Sections in the order in which the signal passes them.
    pub sections: [Section; N],
}

/// Memory of one channel of a cascade of `N` sections: 4 * (2 + 3 N) bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CascadeState<const N: usize> {
    x1: i32,
    x2: i32,
    sections: [SectionState; N],
}

impl<const N: usize> CascadeState<N> {
    /// State after a long input of zeros.
    pub const REST: Self = Self { x1: 0, x2: 0, sections: [SectionState::REST; N] };
}

/// Largest number of sections in a cascade; the code for this many sections is unrolled by hand.
pub const MAX_SECTIONS: usize = 12;

impl<const N: usize> Cascade<N> {
    /// Returns the fractions of all coefficients. [`Compiled`](crate::filter::Compiled) loads them
    /// as data, while section types and integer parts become part of its code.
    pub(crate) const fn fractions(&self) -> [Fractions; N] {
        let mut fractions = [[0; 3]; N];
        let mut index = 0;
        while index < N {
            fractions[index] = self.sections[index].fractions();
            index += 1;
        }
        fractions
    }

    /// Filters `B` consecutive samples of one channel.
    #[inline(always)]
    #[expect(unused_assignments, reason = "the last section's outputs are no section's inputs")]
    pub(crate) fn apply_block<const B: usize>(
        &self,
        fractions: &[Fractions; N],
        state: &mut CascadeState<N>,
        mut block: [i32; B],
    ) -> [i32; B] {
        const { assert!(N <= MAX_SECTIONS, "a cascade has at most 12 sections") };
        let mut earlier_inputs = [state.x1, state.x2];
        for x in block {
            (state.x2, state.x1) = (state.x1, x);
        }
        // Unrolled by hand, because the compiler would keep the loop and select each section's type
        // at run time, which takes more than twice the instructions on a Cortex-M4.
        macro_rules! apply_sections {
            ($($index:literal)*) => {$(
                if $index < N {
                    let (section, memory) = (&self.sections[$index], &mut state.sections[$index]);
                    earlier_inputs =
                        section.apply_block(&fractions[$index], memory, earlier_inputs, &mut block);
                }
            )*};
        }
        apply_sections!(0 1 2 3 4 5 6 7 8 9 10 11);
        block
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{coefficient::Coefficient, filter::Filter};

    /// Returns a stable cascade for the tests: a high-pass with a double pole at 0.9 and a low-pass
    /// with a double pole at 0.5.
    fn cascade() -> Cascade<2> {
        let high_pass =
            Section::HighPass { a1: Coefficient::nearest(1.8), a2: Coefficient::nearest(-0.81) };
        let low_pass = Section::LowPass {
            gain: Coefficient::nearest(0.0625),
            a1: Coefficient::nearest(1.0),
            a2: Coefficient::nearest(-0.25),
        };
        Cascade { sections: [high_pass, low_pass] }
    }

    #[test]
    fn a_constant_offset_decays_to_zero() {
        let mut state = CascadeState::REST;
        let last = (0..2_000).map(|_| cascade().apply(&mut state, 100_000_000)).last();
        assert_eq!(last, Some(0));
    }
}
