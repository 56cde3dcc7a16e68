//! Fully connected layers, forward and backward.

use pulp::NullaryFnOnce;

use super::{LANES, Lanes, add_scaled};

/// Number of outputs that are computed together, so that their sums fill the registers of AVX2.
const TILE: usize = 4;

/// A matrix \[outputs, inputs\] in PyTorch's order, the inputs fastest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix<'a> {
    values: &'a [f32],
    outputs: usize,
    inputs: usize,
}

impl<'a> Matrix<'a> {
    /// Creates a matrix with `inputs` columns from its values, row by row.
    pub(crate) fn new(values: &'a [f32], inputs: usize) -> Self {
        Self { values, outputs: values.len() / inputs, inputs }
    }

    /// Adds the product of the matrix and `x` to `y`.
    pub(crate) fn multiply(&self, x: &[Lanes], y: &mut [Lanes]) {
        pulp::Arch::new().dispatch(Product {
            values: self.values,
            sums: self.outputs,
            strides: [self.inputs, 1],
            x,
            y,
        });
    }

    /// Adds the gradient at the layer's input to `sums`: the product of the transposed matrix and
    /// `gradient`, the gradient at the layer's output.
    pub(crate) fn multiply_transposed(&self, gradient: &[Lanes], sums: &mut [Lanes]) {
        pulp::Arch::new().dispatch(Product {
            values: self.values,
            sums: self.inputs,
            strides: [1, self.inputs],
            x: gradient,
            y: sums,
        });
    }
}

/// Returns the gradient of a matrix, in the matrix's order: for each output and input, the sum over
/// all windows of the input times the gradient at the output.
pub(crate) fn matrix_gradient(x: &[Lanes], gradient: &[Lanes]) -> Vec<f32> {
    let inputs = x.len();
    let mut sums = vec![0.0; gradient.len() * inputs];
    // Store the inputs of each window as one row, so that vector instructions run along matrix
    // rows.
    let mut by_window = vec![0.0; LANES * inputs];
    for (window, row) in by_window.chunks_exact_mut(inputs).enumerate() {
        for (value, lanes) in row.iter_mut().zip(x) {
            *value = lanes[window];
        }
    }
    pulp::Arch::new().dispatch(OuterProduct { by_window: &by_window, gradient, sums: &mut sums });
    sums
}

/// Arguments of the product of a matrix or its transpose with one vector for each window.
struct Product<'a> {
    values: &'a [f32],
    /// Number of elements of the result.
    sums: usize,
    /// Strides in `values`: from one element of the result to the next, and from one element of `x`
    /// to the next.
    strides: [usize; 2],
    x: &'a [Lanes],
    y: &'a mut [Lanes],
}

impl NullaryFnOnce for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let [along_y, along_x] = self.strides;
        let mut first = 0;
        while let Some((tile, _)) = self.y[first..].split_first_chunk_mut::<TILE>() {
            let mut sums = *tile;
            for (at, x) in self.x.iter().enumerate() {
                let at = first * along_y + at * along_x;
                for (output, sums) in sums.iter_mut().enumerate() {
                    add_scaled(sums, self.values[at + output * along_y], x);
                }
            }
            *tile = sums;
            first += TILE;
        }
        for rest in first..self.sums {
            let mut sums = self.y[rest];
            for (at, x) in self.x.iter().enumerate() {
                add_scaled(&mut sums, self.values[rest * along_y + at * along_x], x);
            }
            self.y[rest] = sums;
        }
    }
}

/// Arguments of a sum of outer products, one product for each window.
struct OuterProduct<'a> {
    by_window: &'a [f32],
    gradient: &'a [Lanes],
    sums: &'a mut [f32],
}

impl NullaryFnOnce for OuterProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let inputs = self.by_window.len() / LANES;
        for (gradient, row) in self.gradient.iter().zip(self.sums.chunks_exact_mut(inputs)) {
            for (window, x) in self.by_window.chunks_exact(inputs).enumerate() {
                for (sum, x) in row.iter_mut().zip(x) {
                    *sum = gradient[window].mul_add(*x, *sum);
                }
            }
        }
    }
}
