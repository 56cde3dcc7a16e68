//! Ridge regression.

use nalgebra::DMatrix;

/// Sums from which a linear map is fitted: products of its inputs with themselves and with its outputs.
#[derive(Clone, Debug)]
pub(super) struct Ridge {
    inputs: DMatrix<f64>,
    /// `[input, output]`.
    products: DMatrix<f64>,
}

impl Ridge {
    pub(super) fn new(inputs: usize, outputs: usize) -> Self {
        Self {
            inputs: DMatrix::zeros(inputs, inputs),
            products: DMatrix::zeros(inputs, outputs),
        }
    }

    /// Adds pairs of inputs and outputs; each column is one pair.
    pub(super) fn add(&mut self, inputs: &DMatrix<f32>, outputs: &DMatrix<f32>) {
        let (inputs, outputs) = (inputs.map(f64::from), outputs.map(f64::from));
        self.inputs.gemm(1.0, &inputs, &inputs.transpose(), 1.0);
        self.products.gemm(1.0, &inputs, &outputs.transpose(), 1.0);
    }

    /// Returns the matrix `[output, input]` with the least sum of squared errors plus `penalty` times its own
    /// squares; `None` if the inputs are degenerate and the penalty is 0.
    pub(super) fn solve(mut self, penalty: f64) -> Option<DMatrix<f64>> {
        for index in 0..self.inputs.nrows() {
            self.inputs[(index, index)] += penalty;
        }
        let solution = self.inputs.cholesky()?.solve(&self.products);
        Some(solution.transpose())
    }
}
