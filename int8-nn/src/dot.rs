//! Products of many positions with many outputs: the one loop in which all the time goes.

#[cfg(smlad)]
mod cortex_m;

use crate::{Pair, quad::Quad};

/// Positions that are multiplied together with [`OUTPUTS`] outputs: six accumulators, four weights,
/// two inputs and two pointers are the 14 registers of a Cortex-M.
pub(crate) const POSITIONS: usize = 3;
/// Outputs that are computed together.
pub(crate) const OUTPUTS: usize = 2;
/// Pairs of inputs that are multiplied in one round.
pub(crate) const ROUND: usize = 2;

/// Pairs that the weights of one step take, from the pairs of inputs of a position.
pub(crate) const fn weights_len(inputs: usize) -> usize {
    OUTPUTS * inputs
}

/// Where the weights of a pair of inputs for `output` (0..[`OUTPUTS`]) lie within a step: in rounds,
/// the first output's before the second's.
pub(crate) const fn weight_at(output: usize, input: usize) -> usize {
    (input / ROUND * OUTPUTS + output) * ROUND + input % ROUND
}

/// For each step, [`POSITIONS`] positions times [`OUTPUTS`] outputs:
/// `sums[step][position][output] = sum over segment, k of
/// inputs[segment][(step * POSITIONS + position) * STRIDE + k] . weights[step][segment][k][output]`,
/// wrapping.
///
/// A position's inputs lie in `SEGMENTS` places, `WIDTH` pairs in each, `STRIDE` pairs behind those of
/// the position before. There are as many steps as `sums` has room for; weights of one step alone
/// serve all of them. Order of the weights within a step: [`weight_at`].
///
/// # Panics
/// When a slice is shorter than this asks for.
#[inline]
pub(crate) fn dots<const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
    inputs: [&[Pair]; SEGMENTS],
    weights: &[Pair],
    sums: &mut [[i32; POSITIONS * OUTPUTS]],
) {
    const { assert!(SEGMENTS > 0 && WIDTH > 0 && WIDTH.is_multiple_of(ROUND)) };
    const { assert!(STRIDE <= WIDTH, "a slice ends behind its last position") };
    if sums.is_empty() {
        return;
    }
    let per_step = weights_len(SEGMENTS * WIDTH);
    let is_shared = weights.len() == per_step;
    let steps_of_weights = if is_shared { 1 } else { sums.len() };
    let weights = &weights[..steps_of_weights * per_step];
    let reach = (sums.len() * POSITIONS - 1) * STRIDE + WIDTH;
    let inputs = inputs.map(|segment| &segment[..reach]);
    #[cfg(smlad)]
    if cortex_m::dots::<SEGMENTS, WIDTH, STRIDE>(inputs, weights, is_shared, sums) {
        return;
    }
    for (step, sums) in sums.iter_mut().enumerate() {
        let first = if is_shared { 0 } else { step * per_step };
        let inputs = inputs.map(|segment| &segment[step * POSITIONS * STRIDE..]);
        step_portable::<SEGMENTS, WIDTH, STRIDE>(inputs, &weights[first..first + per_step], sums);
    }
}

/// One step in plain Rust: the twin of the assembler.
///
/// The products of a round lie side by side, `[output][pair]`, and each has a sum of its own until
/// the end.
#[inline]
fn step_portable<const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
    inputs: [&[Pair]; SEGMENTS],
    weights: &[Pair],
    sums: &mut [i32; POSITIONS * OUTPUTS],
) {
    let mut lanes = [Quad::new([Pair::ZERO; OUTPUTS * ROUND]); POSITIONS];
    for (segment, weights) in inputs
        .into_iter()
        .zip(weights.chunks_exact(OUTPUTS * WIDTH))
    {
        // Of as many inputs as the compiler knows, so that nothing is checked in the loop.
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
