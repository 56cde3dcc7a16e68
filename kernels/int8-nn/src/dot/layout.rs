//! Block size of the dot products, and the order of their weights.

/// Number of positions multiplied together with [`OUTPUTS`] outputs. Six accumulators, four
/// weights, two inputs and two pointers fill the 14 usable registers of a Cortex-M.
pub(crate) const POSITIONS: usize = 3;
/// Number of outputs computed together at [`POSITIONS`] positions.
pub(crate) const OUTPUTS: usize = 2;
/// Number of input pairs multiplied in one unrolled round.
pub(crate) const ROUND: usize = 2;

/// Returns the number of weight pairs of one block, for a position with `inputs` pairs of inputs.
pub(crate) const fn weights_len(inputs: usize) -> usize {
    OUTPUTS * inputs
}

/// Returns the index, within the weights of a block, of the weights of input pair `input` for `output`
/// (0..[`OUTPUTS`]). The order is by rounds; within a round the first output's pairs come first.
pub(crate) const fn weight_index(output: usize, input: usize) -> usize {
    (input / ROUND * OUTPUTS + output) * ROUND + input % ROUND
}
