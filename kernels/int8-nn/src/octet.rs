//! Operations on eight 32-bit words at a time, for a PC: in plain Rust or with AVX2.

#[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
mod avx2;

use crate::{
    dot::{OUTPUTS, POSITIONS, ROUND},
    pair::Pair,
};

/// Number of input pairs in two rounds.
pub(crate) const INPUTS: usize = 2 * ROUND;
/// Number of weight pairs in two rounds: one for each pair of inputs and each of the two outputs.
pub(crate) const WEIGHTS: usize = INPUTS * OUTPUTS;

/// Eight words: inputs, weights, or sums of their products. Four words belong to each of two
/// outputs; each implementation has its own order of the words.
pub(crate) trait Octet: Copy {
    /// Returns an octet of zeros.
    fn zeros() -> Self;

    /// Returns two rounds of inputs as an octet; both outputs share them.
    fn inputs(pairs: &[Pair; INPUTS]) -> Self;

    /// Returns two rounds of weights as an octet; `pairs` is `[round][output][pair]`.
    fn weights(pairs: &[Pair; WEIGHTS]) -> Self;

    /// Replaces each 16-bit number by its low byte, sign-extended.
    #[cfg(not(smlad))]
    fn low_bytes(self) -> Self;

    /// Adds to each word of `sums` the dot product of the pairs of `self` and `other`, wrapping.
    fn multiply_add(self, other: Self, sums: Self) -> Self;

    /// Returns, for each output, the sum of its four words, wrapping.
    fn output_sums(self) -> [i32; OUTPUTS];

    /// Returns, for each position, [`Self::output_sums`] of its octet.
    #[inline(always)]
    fn position_sums(positions: [Self; POSITIONS]) -> [i32; POSITIONS * OUTPUTS] {
        let mut sums = [0; POSITIONS * OUTPUTS];
        for (sums, octet) in sums.as_chunks_mut().0.iter_mut().zip(positions) {
            *sums = octet.output_sums();
        }
        sums
    }
}

/// A computation that [`run`] can execute with any implementation of octets.
#[cfg(not(smlad))]
pub(crate) trait Kernel {
    /// Runs the computation. All functions from here down to the octets must be `inline(always)`,
    /// because only inlined code is compiled for the instruction set of the implementation.
    fn run<O: Octet>(self);
}

/// Runs a kernel with the fastest implementation of octets that the processor supports.
#[cfg(not(smlad))]
#[inline(always)]
pub(crate) fn run(kernel: impl Kernel) {
    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    let Some(kernel) = avx2::run_if_available(kernel) else {
        return;
    };
    kernel.run::<Plain>();
}

/// Octets in plain Rust, for every processor. The order of the words is `[round][output][pair]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain([Pair; WEIGHTS]);

impl Octet for Plain {
    #[inline(always)]
    fn zeros() -> Self {
        Self([Pair::ZERO; WEIGHTS])
    }

    #[inline(always)]
    fn inputs(&[a, b, c, d]: &[Pair; INPUTS]) -> Self {
        Self([a, b, a, b, c, d, c, d])
    }

    #[inline(always)]
    fn weights(pairs: &[Pair; WEIGHTS]) -> Self {
        Self(*pairs)
    }

    #[cfg(not(smlad))]
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the low byte")]
    fn low_bytes(self) -> Self {
        let low_byte = |number: i16| i16::from(number as i8);
        Self(self.0.map(|pair| Pair::new(pair.get().map(low_byte))))
    }

    #[inline(always)]
    fn multiply_add(self, other: Self, sums: Self) -> Self {
        Self(core::array::from_fn(|at| {
            let [a, b] = self.0[at].get().map(i32::from);
            let [c, d] = other.0[at].get().map(i32::from);
            let sum = sums.0[at].0.cast_signed();
            Pair(sum.wrapping_add(a * c).wrapping_add(b * d).cast_unsigned())
        }))
    }

    #[inline(always)]
    fn output_sums(self) -> [i32; OUTPUTS] {
        core::array::from_fn(|output| {
            let words = [0, 1, INPUTS, INPUTS + 1].map(|at| self.0[output * ROUND + at]);
            words.iter().fold(0, |sum: i32, word| sum.wrapping_add(word.0.cast_signed()))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Results of one test step: sums of three positions, and sums with the weights' low bytes.
    type Sums = ([i32; POSITIONS * OUTPUTS], [i32; OUTPUTS]);

    /// Number of steps of the test, each of which multiplies different numbers.
    const STEPS: usize = 1_000;

    /// A computation that records its sums after each step. Many of its operands are extreme
    /// values.
    struct Operations<'r>(&'r mut Vec<Sums>);

    impl Kernel for Operations<'_> {
        #[inline(always)]
        fn run<O: Octet>(self) {
            let (mut sums, mut low_sums) = ([O::zeros(); POSITIONS], O::zeros());
            for step in 0..STEPS {
                let weights = O::weights(&pairs(7 * step + 1));
                for (position, sums) in sums.iter_mut().enumerate() {
                    let inputs = O::inputs(&pairs(step + 31 * position));
                    *sums = inputs.multiply_add(weights, *sums);
                }
                let inputs = O::inputs(&pairs(step));
                low_sums = inputs.multiply_add(weights.low_bytes(), low_sums);
                self.0.push((O::position_sums(sums), low_sums.output_sums()));
            }
        }
    }

    fn pairs<const N: usize>(step: usize) -> [Pair; N] {
        let numbers = [0, 1, -1, 127, -128, 255, 4080, 9144, i16::MAX, i16::MIN];
        let number = |at: usize| numbers[step * (at + 1) / 3 % numbers.len()];
        core::array::from_fn(|at| Pair::new([number(2 * at), number(2 * at + 1)]))
    }

    #[test]
    fn both_implementations_return_the_same_sums_at_the_ends_of_every_range() {
        // `tests/literal.rs` compares the faster implementation with plain loops.
        let (mut plain, mut fastest) = (Vec::new(), Vec::new());
        Operations(&mut plain).run::<Plain>();
        run(Operations(&mut fastest));
        assert_eq!(plain, fastest);
    }
}
