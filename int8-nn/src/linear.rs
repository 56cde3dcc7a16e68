//! Fully connected layers, accumulated piece by piece.

#[cfg(smlad)]
mod cortex_m;

use crate::Pair;
#[cfg(not(smlad))]
use crate::quad::Quad;

/// Outputs that are computed together: two pairs.
const OUTPUTS: usize = 4;
/// Pairs of inputs that are multiplied in one round.
const ROUND: usize = 2;
/// Rounds are unrolled, so pairs of inputs come in so many.
const INPUTS: usize = 8;
/// Most outputs: their product with the inputs fits any word.
const MOST_OUTPUTS: usize = 65_536;

/// A matrix that adds a slice of a layer's inputs to all its outputs.
///
/// A fully connected layer over a window is one `Linear` per plane; the accumulators start at the
/// bias and every plane is added when it arrives.
///
/// Two weights of 8 bits share a number of 16: `256 * odd + even`, for an odd output and the even one
/// before it. Products with the number as it is give `256 * odd sum + even sum`, products with its low
/// byte the even sum; what is left of the first is the odd one. So every second weight needs no
/// instruction of its own to be taken out of its byte, and memory holds 8 bits for each.
#[derive(Clone, Copy, Debug)]
pub struct Linear<'w> {
    /// Pairs of inputs: a multiple of 8, at most 128. Fill up with zeros.
    pub inputs: usize,
    /// Number of outputs: a multiple of 4.
    pub outputs: usize,
    /// What [`Self::pack_weights`] makes, [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
}

impl Linear<'_> {
    /// Most pairs of inputs: 257 products of 255 and 128 stay below 2^23.
    pub const MOST_INPUTS: usize = 128;

    /// Pairs in the packed weights.
    pub const fn weights_len(&self) -> usize {
        self.inputs * self.outputs / 2
    }

    /// True when this is a matrix from so many pairs of inputs to `outputs` numbers; assert it in
    /// `const`.
    pub const fn is_consistent(&self, inputs: usize, outputs: usize) -> bool {
        self.inputs == inputs
            && self.outputs == outputs
            && inputs > 0
            && inputs.is_multiple_of(INPUTS)
            && inputs <= Self::MOST_INPUTS
            && outputs > 0
            && outputs.is_multiple_of(OUTPUTS)
            && outputs <= MOST_OUTPUTS
            && self.weights.len() == self.weights_len()
    }

    /// Adds `weights * inputs` to the accumulators, wrapping; |input| <= 255.
    ///
    /// # Panics
    /// When a slice is shorter than the matrix says, or the matrix is none: [`Self::is_consistent`].
    pub fn accumulate(&self, inputs: &[Pair], accumulators: &mut [i32]) {
        assert!(
            self.is_consistent(self.inputs, self.outputs),
            "a matrix of whole rounds and as many weights"
        );
        let inputs = &inputs[..self.inputs];
        let accumulators = &mut accumulators[..self.outputs];
        #[cfg(smlad)]
        cortex_m::accumulate(inputs, self.weights, accumulators);
        #[cfg(not(smlad))]
        accumulate_portable(inputs, self.weights, accumulators);
    }

    /// Orders weights `[input][output]` as [`Self::weights`] holds them, for so many pairs of inputs;
    /// those beyond the weights get zeros.
    ///
    /// # Panics
    /// When there are more weights than the matrix has room for, or a weight is -128: `256 * odd +
    /// even` has to fit 16 bits.
    pub fn pack_weights(inputs: usize, outputs: usize, weights: &[i8], packed: &mut [Pair]) {
        assert!(weights.len() <= 2 * inputs * outputs, "a weight for each");
        packed.fill(Pair::ZERO);
        for (at, &weight) in weights.iter().enumerate() {
            assert!(weight != i8::MIN, "weights are symmetric");
            let (input, output) = (at / outputs, at % outputs);
            let (pair, lane) = (input / 2, input % 2);
            let round = output / OUTPUTS * (inputs / ROUND) + pair / ROUND;
            let both = &mut packed[(round * 2 + output % OUTPUTS / 2) * ROUND + pair % ROUND];
            let shared = both.get()[lane] + (i16::from(weight) << (8 * (output % 2)));
            *both = both.with(lane, shared);
        }
    }
}

/// The twin of the assembler, in plain Rust.
#[cfg(not(smlad))]
fn accumulate_portable(inputs: &[Pair], weights: &[Pair], accumulators: &mut [i32]) {
    let quads = weights.chunks_exact(inputs.len() * OUTPUTS / 2);
    for (weights, outputs) in quads.zip(accumulators.as_chunks_mut::<OUTPUTS>().0) {
        let zeros = Quad::new([Pair::ZERO; 2 * ROUND]);
        let (mut both, mut even) = (zeros, zeros);
        let rounds = weights.as_chunks::<{ 2 * ROUND }>().0;
        for (&[x, y], &weights) in inputs.as_chunks::<ROUND>().0.iter().zip(rounds) {
            let (inputs, weights) = (Quad::new([x, y, x, y]), Quad::new(weights));
            both = inputs.multiply_add(weights, both);
            even = inputs.multiply_add(weights.low_bytes(), even);
        }
        let [both, even] = [both, even].map(|lanes| {
            let [a, b, c, d] = lanes.words();
            [a.wrapping_add(b), c.wrapping_add(d)]
        });
        for (index, outputs) in outputs.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            let odd = both[index].wrapping_sub(even[index]) >> 8;
            *outputs = [
                outputs[0].wrapping_add(even[index]),
                outputs[1].wrapping_add(odd),
            ];
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{vec, vec::Vec};

    use super::*;

    #[test]
    fn a_linear_layer_is_a_matrix_product_on_top_of_what_is_there() {
        let (inputs, outputs) = (8, 8);
        // The largest that can come together, at the ends of their ranges.
        let weights: Vec<i8> = (0..13 * outputs)
            .map(|at| [127, -127, 1, -1, 0, 100][at * 7 % 6])
            .collect();
        let x: Vec<i16> = (0..2 * inputs)
            .map(|at| [255, -128, 0, 77][at % 4])
            .collect();
        let mut packed = vec![Pair::ZERO; inputs * outputs / 2];
        Linear::pack_weights(inputs, outputs, &weights, &mut packed);
        let layer = Linear {
            inputs,
            outputs,
            weights: &packed,
        };
        assert!(layer.is_consistent(inputs, outputs));
        let mut sums: Vec<i32> = (0..8).collect();
        let pairs: Vec<Pair> = x
            .as_chunks()
            .0
            .iter()
            .map(|&pair| Pair::new(pair))
            .collect();
        layer.accumulate(&pairs, &mut sums);
        for (output, (sum, before)) in sums.iter().zip(0..).enumerate() {
            let product =
                |input: usize| i32::from(x[input]) * i32::from(weights[input * outputs + output]);
            assert_eq!(*sum, before + (0..13).map(product).sum::<i32>());
        }
    }
}
