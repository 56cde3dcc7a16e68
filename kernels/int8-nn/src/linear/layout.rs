//! Block sizes of a matrix product, and the order of its weights.

/// Number of outputs computed together: two pairs.
pub(super) const OUTPUTS: usize = 4;
/// Number of input pairs multiplied in one unrolled round.
pub(super) const ROUND: usize = 2;
/// Number of input pairs in one iteration of the assembler loop; the rounds of an iteration are
/// unrolled.
pub(super) const INPUTS: usize = 8;

/// Returns the index of the pair that holds the weight of input pair `pair` for `output`, in a matrix
/// with `inputs` pairs of inputs.
pub(super) const fn weight_index(inputs: usize, pair: usize, output: usize) -> usize {
    let round = output / OUTPUTS * (inputs / ROUND) + pair / ROUND;
    (round * 2 + output % OUTPUTS / 2) * ROUND + pair % ROUND
}
