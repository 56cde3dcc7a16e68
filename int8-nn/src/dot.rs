//! Dot products of many positions with many outputs: the inner loop of every convolution.

#[cfg(smlad)]
mod cortex_m;
pub(crate) mod layout;

use crate::{pair::Pair, quad::Quad};
use layout::{OUTPUTS, POSITIONS, ROUND, weights_len};

/// Computes, for each block of `sums`, the dot products of [`POSITIONS`] positions and [`OUTPUTS`]
/// outputs:
/// `sums[block][position][output] = sum over segment, k of
/// inputs[segment][(block * POSITIONS + position) * STRIDE + k] . weights[block][segment][k][output]`,
/// wrapping.
///
/// The inputs of a position are `WIDTH` consecutive pairs in each of the `SEGMENTS` slices; those of
/// the next position start `STRIDE` pairs later. If `weights` holds the weights of one block only, all
/// blocks use them. Order of the weights within a block: [`layout::weight_index`].
///
/// # Panics
/// If a slice is shorter than the formula requires.
#[inline]
pub(crate) fn dots<const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
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
        block_portable::<SEGMENTS, WIDTH, STRIDE>(inputs, &weights[first..first + per_block], sums);
    }
}

/// Computes one block in plain Rust: the portable equivalent of the assembler.
///
/// For each position, a [`Quad`] accumulates four separate sums, `[output][pair of the round]`. The two
/// sums of each output are added at the end.
#[inline]
fn block_portable<const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
    inputs: [&[Pair]; SEGMENTS],
    weights: &[Pair],
    sums: &mut [i32; POSITIONS * OUTPUTS],
) {
    let mut lanes = [Quad::new([Pair::ZERO; OUTPUTS * ROUND]); POSITIONS];
    for (segment, weights) in inputs
        .into_iter()
        .zip(weights.chunks_exact(OUTPUTS * WIDTH))
    {
        // Arrays of known length, so that the loop has no bounds checks.
        let positions: [&[Pair; WIDTH]; POSITIONS] = core::array::from_fn(|position| {
            let inputs = &segment[position * STRIDE..][..WIDTH];
            &inputs.as_chunks().0[0]
        });
        let rounds = weights.as_chunks::<{ OUTPUTS * ROUND }>().0;
        for (round, &weights) in rounds.iter().enumerate() {
            let weights = Quad::new(weights);
            for (lanes, inputs) in lanes.iter_mut().zip(positions) {
                let [x, y] = [inputs[ROUND * round], inputs[ROUND * round + 1]];
                *lanes = Quad::new([x, y, x, y]).multiply_add(weights, *lanes);
            }
        }
    }
    for (sums, lanes) in sums.as_chunks_mut::<OUTPUTS>().0.iter_mut().zip(lanes) {
        let [a, b, c, d] = lanes.words();
        *sums = [a.wrapping_add(b), c.wrapping_add(d)];
    }
}
