//! The decoder's unpooling and first transposed convolution, computed together.

use crate::convolution::{Convolution, Volume};
use crate::geometry::{CONV1_CHANNELS, CONV2_CHANNELS, Geometry, KERNEL};

/// Number of weights for each pair of input and output channel: 3 steps x 3 rows x 3 columns.
const TAPS: usize = KERNEL * KERNEL * KERNEL;

/// One value for each output channel.
type Outputs = [f32; CONV1_CHANNELS];

/// Nearest-neighbour unpooling followed by a transposed convolution, cropped to the output size of
/// the encoder's first convolution.
///
/// Unpooling repeats each pooled value, for example 10 times; here each product of a pooled value
/// and a weight is computed once and added to all outputs that need it. The output channels are
/// innermost, so that the compiler vectorises the loops. With the built-in model, a window decodes
/// in 0.37 ms instead of the 0.75 ms of two separate layers (x86-64 with SSE2, 7.3 million
/// instructions instead of 11.6 million).
///
/// Each sum starts with its bias. The products are added in the order input channel, tap (step,
/// row, column of the kernel), as two separate layers would add them.
#[derive(Clone, Debug)]
pub(crate) struct UnpooledConvolution {
    /// Weights in the order `[input][tap][output]`.
    weights: Vec<[Outputs; TAPS]>,
    bias: Outputs,
    /// Number of positions (step, row, column) in the pooled input.
    cells: usize,
    /// Numbers of steps, rows and columns of the output.
    size: [usize; 3],
    /// For each output position (column fastest), its products in the order in which they are
    /// added; each is an index `tap * cells + cell`.
    products: Vec<usize>,
    /// For each output position, the end of its products in `products`.
    ends: Vec<usize>,
}

impl UnpooledConvolution {
    /// Rearranges the weights of a transposed convolution for volumes of this geometry.
    pub(crate) fn new(convolution: &Convolution, geometry: &Geometry) -> Self {
        let mut bias = [0.0; CONV1_CHANNELS];
        bias.copy_from_slice(&convolution.bias);
        let mut weights = vec![[[0.0; CONV1_CHANNELS]; TAPS]; CONV2_CHANNELS];
        for (at, weight) in convolution.weight.iter().enumerate() {
            let (input, output) = (at / TAPS / CONV1_CHANNELS, at / TAPS % CONV1_CHANNELS);
            weights[input][at % TAPS][output] = *weight;
        }
        let [steps, rows, columns] = geometry.hidden;
        let (mut products, mut ends) = (Vec::new(), Vec::new());
        for step in 0..steps {
            for row in 0..rows {
                for column in 0..columns {
                    products.extend(products_of([step, row, column], geometry));
                    ends.push(products.len());
                }
            }
        }
        Self {
            weights,
            bias,
            cells: geometry.pooled.iter().product(),
            size: geometry.hidden,
            products,
            ends,
        }
    }

    /// Unpools and convolves the pooled values `[input][step][row][column]`.
    pub(crate) fn forward(&self, pooled: &[f32]) -> Volume {
        let mut sums = vec![self.bias; self.ends.len()];
        let mut products = vec![[0.0; CONV1_CHANNELS]; TAPS * self.cells];
        for (weights, values) in self.weights.iter().zip(pooled.chunks_exact(self.cells)) {
            multiply(weights, values, &mut products);
            let mut start = 0;
            for (sums, &end) in sums.iter_mut().zip(&self.ends) {
                // A local copy, which stays in registers. The compiler would reload `sums` on every
                // pass, because it cannot prove that `sums` and the products do not overlap.
                let mut outputs = *sums;
                for &product in &self.products[start..end] {
                    for (output, product) in outputs.iter_mut().zip(&products[product]) {
                        *output += product;
                    }
                }
                *sums = outputs;
                start = end;
            }
        }
        let channels = 0..CONV1_CHANNELS;
        Volume {
            channels: CONV1_CHANNELS,
            size: self.size,
            values: channels
                .flat_map(|channel| sums.iter().map(move |outputs| outputs[channel]))
                .collect(),
        }
    }
}

/// Multiplies all values of one pooled channel by all its weights; `products` is `[tap][cell]`.
fn multiply(weights: &[Outputs; TAPS], values: &[f32], products: &mut [Outputs]) {
    for (weights, products) in weights.iter().zip(products.chunks_exact_mut(values.len())) {
        for (value, products) in values.iter().zip(products) {
            *products = weights.map(|weight| weight * value);
        }
    }
}

/// Returns the indices `tap * cells + cell` of the products that the output at `position` sums.
///
/// Before cropping, output position p sums tap k times the unpooled value at p - k, for each k for
/// which that value exists. Unpooled position p of n repeats pooled position floor(p * m / n),
/// where m is the pooled size, as in PyTorch's `interpolate`. For example, the first three of five
/// columns repeat pooled column 0 of two.
fn products_of(position: [usize; 3], geometry: &Geometry) -> impl Iterator<Item = usize> {
    let (pooled, unpooled) = (geometry.pooled, geometry.feature_map);
    let pads = geometry.padding.pads();
    (0..TAPS).filter_map(move |tap| {
        let taps = [tap / (KERNEL * KERNEL), tap / KERNEL % KERNEL, tap % KERNEL];
        let mut cell = 0;
        for axis in 0..3 {
            let at = (position[axis] + pads[axis]).checked_sub(taps[axis])?;
            if at >= unpooled[axis] {
                return None;
            }
            cell = cell * pooled[axis] + at * pooled[axis] / unpooled[axis];
        }
        Some(tap * pooled.iter().product::<usize>() + cell)
    })
}
