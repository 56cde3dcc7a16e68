//! Fully connected layers, accumulated piece by piece.

use crate::conv3d::multiply_add;

/// A matrix that adds a slice of a layer's inputs to all its outputs.
///
/// A fully connected layer over a window is one `Linear` per plane; the accumulators start at the
/// bias and every plane is added when it arrives.
#[derive(Clone, Copy, Debug)]
pub struct Linear<'w> {
    /// Number of outputs.
    pub outputs: usize,
    /// `[input][output]`.
    pub weights: &'w [i8],
}

impl Linear<'_> {
    /// True when this is a matrix from `inputs` to `outputs` numbers; assert it in `const`.
    pub const fn is_consistent(&self, inputs: usize, outputs: usize) -> bool {
        self.outputs == outputs && outputs > 0 && self.weights.len() == inputs * outputs
    }

    /// Adds `weights * inputs` to the accumulators, wrapping.
    ///
    /// # Panics
    /// When `accumulators` is shorter than the outputs; in debug builds also when the number of
    /// inputs is not that of the matrix.
    pub fn accumulate<T: Copy + Into<i32>>(&self, inputs: &[T], accumulators: &mut [i32]) {
        debug_assert!(
            self.is_consistent(inputs.len(), self.outputs),
            "inputs of a linear layer"
        );
        let sums = &mut accumulators[..self.outputs];
        for (&x, weights) in inputs.iter().zip(self.weights.chunks_exact(self.outputs)) {
            multiply_add(sums, x.into(), weights);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_layer_is_a_matrix_product_on_top_of_what_is_there() {
        let layer = Linear {
            outputs: 2,
            weights: &[1, -2, 3, 4, 5, 127],
        };
        let mut sums = [100, 200];
        layer.accumulate(&[10_i8, -1, 2], &mut sums);
        assert_eq!(sums, [100 + 10 - 3 + 10, 200 - 20 - 4 + 254]);
    }
}
