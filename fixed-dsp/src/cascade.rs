//! Sections in series.

use crate::{Section, SectionState, section::Remainders};

/// Configuration of `N` sections in series, at most [`LONGEST`]; shared by all channels.
///
/// Wraps on overflow: the L1 norm of every prefix's impulse response times the input range must
/// stay below 2^31 (model-gen proves it for the cascades that it emits).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cascade<const N: usize> {
    /// In the order in which the signal passes.
    pub sections: [Section; N],
}

/// What one channel of a cascade of `N` sections remembers: 4 * (2 + 3 N) bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CascadeState<const N: usize> {
    x1: i32,
    x2: i32,
    sections: [SectionState; N],
}

impl<const N: usize> CascadeState<N> {
    /// The state at rest: all inputs and outputs so far were zero.
    pub const REST: Self = Self {
        x1: 0,
        x2: 0,
        sections: [SectionState::REST; N],
    };
}

impl<const N: usize> Default for CascadeState<N> {
    fn default() -> Self {
        Self::REST
    }
}

/// Most sections in a cascade.
pub const LONGEST: usize = 12;

impl<const N: usize> Cascade<N> {
    /// What the compiler does not know of a cascade whose shapes and integers it knows.
    pub(crate) const fn remainders(&self) -> [Remainders; N] {
        let mut remainders = [[0; 3]; N];
        let mut index = 0;
        while index < N {
            remainders[index] = self.sections[index].remainders();
            index += 1;
        }
        remainders
    }

    /// Filters consecutive samples of one channel.
    #[inline(always)]
    #[expect(unused_assignments, reason = "nobody asks for the last section's")]
    pub(crate) fn run<const B: usize>(
        &self,
        remainders: &[Remainders; N],
        state: &mut CascadeState<N>,
        mut block: [i32; B],
    ) -> [i32; B] {
        const { assert!(N <= LONGEST, "a cascade has at most 12 sections") };
        let mut before = [state.x1, state.x2];
        for x in block {
            (state.x2, state.x1) = (state.x1, x);
        }
        // Written out, because the compiler does not unroll a loop of this size and would decide at
        // run time what it knows: more than twice the instructions on a Cortex-M4.
        macro_rules! in_turn {
            ($($index:literal)*) => {$(
                if $index < N {
                    let (section, memory) = (&self.sections[$index], &mut state.sections[$index]);
                    before = section.block(&remainders[$index], memory, before, &mut block);
                }
            )*};
        }
        in_turn!(0 1 2 3 4 5 6 7 8 9 10 11);
        block
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::{Coefficient, Filter};

    /// DC-blocking high-pass and a gentle low-pass, poles at 0.9 and 0.5 (double): arbitrary but
    /// stable, so that behaviour and not a design is tested here.
    fn cascade() -> Cascade<2> {
        let high_pass = Section::HighPass {
            first: Coefficient::nearest(1.8),
            second: Coefficient::nearest(-0.81),
        };
        let low_pass = Section::LowPass {
            gain: Coefficient::nearest(0.0625),
            first: Coefficient::nearest(1.0),
            second: Coefficient::nearest(-0.25),
        };
        Cascade {
            sections: [high_pass, low_pass],
        }
    }

    /// The same difference equations in f64: the independent reference.
    fn reference(input: &[i32]) -> Vec<f64> {
        let mut signal: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
        for (b, a) in [
            ([1.0, -2.0, 1.0], [1.8, -0.81]),
            ([0.0625, 0.125, 0.0625], [1.0, -0.25]),
        ] {
            let (mut x1, mut x2, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0);
            for v in &mut signal {
                let y = b[0] * *v + b[1] * x1 + b[2] * x2 + a[0] * y1 + a[1] * y2;
                (x2, x1, y2, y1) = (x1, *v, y1, y);
                *v = y;
            }
        }
        signal
    }

    #[test]
    fn the_fixed_point_output_follows_the_float_one_within_the_shaped_noise() {
        // An error in [0, 1) enters as e[n] - e[n-1] and passes 1/A: at most half the L1 norm of
        // (1 - z) / A, which is 7.8 for the double pole at 0.9 and 2.0 for the one at 0.5.
        let mut noise = 12_345_u32;
        let input: Vec<i32> = (0..4_000)
            .map(|_| {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                noise.cast_signed() >> 8
            })
            .collect();
        let mut state = CascadeState::default();
        for (&x, expected) in input.iter().zip(reference(&input)) {
            let y = cascade().step(&mut state, x);
            assert!(
                (f64::from(y) - expected).abs() < 4.9,
                "{y} instead of {expected}"
            );
        }
    }

    #[test]
    fn a_constant_offset_decays_to_zero() {
        let mut state = CascadeState::default();
        let last = (0..2_000)
            .map(|_| cascade().step(&mut state, 100_000_000))
            .last();
        assert_eq!(last, Some(0));
    }

    #[test]
    fn silence_after_a_signal_leaves_no_limit_cycle_above_one_step() {
        let mut state = CascadeState::default();
        for k in 0..100 {
            cascade().step(&mut state, if k % 7 < 3 { 90_000_000 } else { -90_000_000 });
        }
        for _ in 0..2_000 {
            cascade().step(&mut state, 0);
        }
        for _ in 0..1_000 {
            assert!(cascade().step(&mut state, 0).abs() <= 1);
        }
    }
}
