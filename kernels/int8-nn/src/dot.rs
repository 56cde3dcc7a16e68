//! Dot products of inputs at many positions with weights of many outputs: the loop of a
//! convolution.

#[cfg(smlad)]
mod cortex_m;

use crate::{
    octet::{INPUTS, Octet, WEIGHTS},
    pair::Pair,
};

/// Number of positions in a block, for which the sums of [`OUTPUTS`] outputs are computed together.
/// A Cortex-M's 14 registers then hold six accumulators, four weights, two inputs and two pointers.
pub(crate) const POSITIONS: usize = 3;
/// Number of outputs in a block, whose sums are computed together for [`POSITIONS`] positions.
pub(crate) const OUTPUTS: usize = 2;
/// Number of input pairs that one round of the unrolled loop multiplies.
pub(crate) const ROUND: usize = 2;

/// Returns the number of weight pairs of a block, for positions with `inputs` pairs of inputs.
pub(crate) const fn weights_len(inputs: usize) -> usize {
    OUTPUTS * inputs
}

/// Returns the index, within the weights of a block, of the weights of input pair `input` for
/// output `output` (0..[`OUTPUTS`]). The weights are ordered by rounds; in each round, the pairs of
/// the first output come first.
pub(crate) const fn weight_index(output: usize, input: usize) -> usize {
    (input / ROUND * OUTPUTS + output) * ROUND + input % ROUND
}

/// Computes, for each block of `sums`, the dot products of [`POSITIONS`] positions and [`OUTPUTS`]
/// outputs: `sums[block][position][output] = sum over segment, k of inputs[segment][(block *
/// POSITIONS + position) * STRIDE + k] . weights[block][segment][k][output]`, wrapping.
///
/// The inputs of a position are `WIDTH` consecutive pairs in each of the `SEGMENTS` slices; the
/// inputs of the next position start `STRIDE` pairs later. If `weights` holds the weights of only
/// one block, all blocks use them. [`weight_index`] defines the order of the weights within a
/// block.
///
/// # Panics
/// If a slice is shorter than the formula requires.
#[inline(always)]
pub(crate) fn dots<O: Octet, const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
    inputs: [&[Pair]; SEGMENTS],
    weights: &[Pair],
    sums: &mut [[i32; POSITIONS * OUTPUTS]],
) {
    const { assert!(SEGMENTS > 0 && WIDTH > 0 && WIDTH.is_multiple_of(ROUND)) };
    const { assert!(STRIDE <= WIDTH, "a run of inputs reaches the next position") };
    if sums.is_empty() {
        return;
    }
    let per_block = weights_len(SEGMENTS * WIDTH);
    let is_shared = weights.len() == per_block;
    let blocks_of_weights = if is_shared { 1 } else { sums.len() };
    let weights = &weights[..blocks_of_weights * per_block];
    let reach = (sums.len() * POSITIONS - 1) * STRIDE + WIDTH;
    let inputs = inputs.map(|segment| &segment[..reach]);
    #[cfg(smlad)]
    if cortex_m::dots::<SEGMENTS, WIDTH, STRIDE>(inputs, weights, is_shared, sums) {
        return;
    }
    for (block, sums) in sums.iter_mut().enumerate() {
        let first = if is_shared { 0 } else { block * per_block };
        let inputs = inputs.map(|segment| &segment[block * POSITIONS * STRIDE..]);
        *sums = block_portable::<O, SEGMENTS, WIDTH, STRIDE>(
            inputs,
            &weights[first..first + per_block],
        );
    }
}

/// Returns the sums of one block, computed with octets; the portable equivalent of the assembler.
#[inline(always)]
fn block_portable<O: Octet, const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
    inputs: [&[Pair]; SEGMENTS],
    weights: &[Pair],
) -> [i32; POSITIONS * OUTPUTS] {
    let mut sums = [O::zeros(); POSITIONS];
    for (segment, weights) in inputs.into_iter().zip(weights.chunks_exact(OUTPUTS * WIDTH)) {
        // The known lengths of these arrays make bounds checks in the loop below unnecessary.
        let positions: [&[Pair; WIDTH]; POSITIONS] = core::array::from_fn(|position| {
            let inputs = &segment[position * STRIDE..][..WIDTH];
            &inputs.as_chunks().0[0]
        });
        let (weights, last_weights) = weights.as_chunks::<WEIGHTS>();
        for (at, weights) in weights.iter().enumerate() {
            let weights = O::weights(weights);
            for (sums, inputs) in sums.iter_mut().zip(positions) {
                let inputs = O::inputs(&inputs.as_chunks::<INPUTS>().0[at]);
                *sums = inputs.multiply_add(weights, *sums);
            }
        }
        // If the number of rounds is odd, the last round is paired with a round of zeros.
        let zero = Pair::ZERO;
        if let &[a, b, c, d] = last_weights {
            let weights = O::weights(&[a, b, c, d, zero, zero, zero, zero]);
            for (sums, inputs) in sums.iter_mut().zip(positions) {
                let inputs = O::inputs(&[inputs[WIDTH - 2], inputs[WIDTH - 1], zero, zero]);
                *sums = inputs.multiply_add(weights, *sums);
            }
        }
    }
    O::position_sums(sums)
}
