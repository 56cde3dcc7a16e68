//! Eight words that a PC processes together.

use crate::{
    dot::layout::{OUTPUTS, POSITIONS, ROUND},
    pair::Pair,
};

/// Number of pairs in two rounds of inputs.
pub(crate) const INPUTS: usize = 2 * ROUND;
/// Number of pairs in two rounds of the weights of two outputs.
pub(crate) const WEIGHTS: usize = INPUTS * OUTPUTS;

/// Two rounds of inputs or weights, or the sums of their products: four words for each of two outputs,
/// in the order of the implementation.
pub(crate) trait Octet: Copy {
    /// Returns eight zeros.
    fn zeros() -> Self;

    /// Packs two rounds of inputs, which both outputs share.
    fn inputs(pairs: &[Pair; INPUTS]) -> Self;

    /// Packs two rounds of weights, `[round][output][pair]`.
    fn weights(pairs: &[Pair; WEIGHTS]) -> Self;

    /// Returns the low byte of each 16-bit number, sign-extended.
    #[cfg(not(smlad))]
    fn low_bytes(self) -> Self;

    /// Returns `sums` plus the dot product of each pair of `self` and `other`, wrapping.
    fn multiply_add(self, other: Self, sums: Self) -> Self;

    /// Returns the sum of the four words of each output, wrapping.
    fn output_sums(self) -> [i32; OUTPUTS];

    /// Returns [`Self::output_sums`] of each position.
    #[inline(always)]
    fn position_sums(positions: [Self; POSITIONS]) -> [i32; POSITIONS * OUTPUTS] {
        let mut sums = [0; POSITIONS * OUTPUTS];
        for (sums, octet) in sums.as_chunks_mut().0.iter_mut().zip(positions) {
            *sums = octet.output_sums();
        }
        sums
    }
}

/// A computation that [`run`](crate::processor::run) compiles for each implementation of octets.
#[cfg(not(smlad))]
pub(crate) trait Kernel {
    /// Runs the computation. Everything between this function and the octets must be `inline(always)`,
    /// because only inlined code is compiled for the processor of the implementation.
    fn run<O: Octet>(self);
}
