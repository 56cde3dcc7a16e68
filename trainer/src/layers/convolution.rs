//! Convolution and transposed convolution with 3 x 3 x 3 kernels, forward and backward.
//!
//! The forward pass and the gradient at the input are correlations of a volume with kernels
//! ([`correlate`]); [`weight_gradient`] computes the gradient of the kernels.

use super::{LANES, Lanes, Volume, add_scaled, product, total};
use crate::parameters;
use artifact::KERNEL;
use pulp::{NullaryFnOnce, Simd, WithSimd};

/// Number of channels that are computed together, so that their sums fill the registers of AVX2.
const TILE: usize = 4;
/// Number of values of a kernel.
const TAPS: usize = KERNEL * KERNEL * KERNEL;

/// Kernels and bias of a layer, in PyTorch's order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer<'a> {
    /// Kernels: \[output, input, step, row, column\] in a convolution, \[input, output, step, row,
    /// column\] in a transposed convolution.
    pub(crate) weight: &'a [f32],
    /// Bias of each output channel.
    pub(crate) bias: &'a [f32],
    /// Number of zeros that pad each axis at both ends, 0 or 1. A transposed convolution instead
    /// crops its output by this number.
    pub(crate) pads: [usize; 3],
}

impl Layer<'_> {
    /// Returns the convolution of `x`.
    pub(crate) fn convolve(&self, x: &Volume) -> Volume {
        correlate(x, &self.kernels(self.bias.len(), x.channels), self.bias, self.pads)
    }

    /// Returns the gradient at the input of a convolution with `inputs` channels, from the gradient
    /// at its output.
    pub(crate) fn convolve_gradient(&self, inputs: usize, gradient: &Volume) -> Volume {
        let kernels = self.turned_kernels(inputs, gradient.channels);
        correlate(gradient, &kernels, &vec![0.0; inputs], self.turned_pads())
    }

    /// Returns the transposed convolution of `x`.
    pub(crate) fn convolve_transposed(&self, x: &Volume) -> Volume {
        let kernels = self.turned_kernels(self.bias.len(), x.channels);
        correlate(x, &kernels, self.bias, self.turned_pads())
    }

    /// Returns the gradient at the input of a transposed convolution with `inputs` channels, from
    /// the gradient at its output.
    pub(crate) fn convolve_transposed_gradient(&self, inputs: usize, gradient: &Volume) -> Volume {
        let kernels = self.kernels(inputs, gradient.channels);
        correlate(gradient, &kernels, &vec![0.0; inputs], self.pads)
    }

    /// Returns the gradients of a convolution's kernels and bias from its input and the gradient at
    /// its output.
    pub(crate) fn parameter_gradient(&self, x: &Volume, gradient: &Volume) -> parameters::Layer {
        parameters::Layer {
            weight: weight_gradient(gradient, &x.padded(self.pads)),
            bias: channel_sums(gradient),
        }
    }

    /// Returns the gradients of a transposed convolution's kernels and bias from its input and the
    /// gradient at its output.
    pub(crate) fn transposed_parameter_gradient(
        &self,
        x: &Volume,
        gradient: &Volume,
    ) -> parameters::Layer {
        parameters::Layer {
            weight: weight_gradient(x, &gradient.padded(self.pads)),
            bias: channel_sums(gradient),
        }
    }

    /// Returns the kernels for [`correlate`]; the first index of `weight` is the output channel,
    /// the second the input channel.
    fn kernels(&self, first: usize, second: usize) -> Kernels {
        Kernels::new(first, second, |output, input, tap| {
            self.weight[(output * second + input) * TAPS + tap]
        })
    }

    /// Returns the kernels for [`correlate`] with reversed taps; the first index of `weight` is the
    /// input channel, the second the output channel.
    fn turned_kernels(&self, second: usize, first: usize) -> Kernels {
        Kernels::new(second, first, |output, input, tap| {
            self.weight[(input * second + output) * TAPS + TAPS - 1 - tap]
        })
    }

    fn turned_pads(&self) -> [usize; 3] {
        self.pads.map(|pad| KERNEL - 1 - pad)
    }
}

/// Returns the sum of each channel over all positions and windows.
fn channel_sums(volume: &Volume) -> Vec<f32> {
    let channels = volume.by_channel();
    let sum = |values: &[Lanes]| values.iter().map(total).sum();
    channels.map(sum).collect()
}

/// Kernels in the order in which [`correlate`] reads them: tile of output channels, input channel,
/// tap, output channel within the tile.
#[derive(Clone, Debug)]
struct Kernels {
    outputs: usize,
    inputs: usize,
    tile: usize,
    values: Vec<f32>,
}

impl Kernels {
    /// Arranges kernels; `value` returns the weight from an input channel to an output channel at a
    /// tap. A tap is an index over step, row and column (the last fastest).
    fn new(outputs: usize, inputs: usize, value: impl Fn(usize, usize, usize) -> f32) -> Self {
        let tile = if outputs.is_multiple_of(TILE) { TILE } else { 1 };
        let mut values = Vec::with_capacity(outputs * inputs * TAPS);
        for first in (0..outputs).step_by(tile) {
            for input in 0..inputs {
                for tap in 0..TAPS {
                    values.extend((first..first + tile).map(|output| value(output, input, tap)));
                }
            }
        }
        Self { outputs, inputs, tile, values }
    }
}

/// Returns the correlation of `x`, padded with `pads` zeros along each axis, with the kernels, plus
/// the bias of each output channel: y\[o\]\[at\] = bias\[o\] + sum over i and k of w\[o\]\[i\]\[k\]
/// x\[i\]\[at + k - pads\].
fn correlate(x: &Volume, kernels: &Kernels, bias: &[f32], pads: [usize; 3]) -> Volume {
    assert_eq!(x.channels, kernels.inputs, "a kernel for each input channel");
    let output = |axis: usize| x.size[axis] + 2 * pads[axis] + 1 - KERNEL;
    let mut y = Volume::zeros(kernels.outputs, [0, 1, 2].map(output));
    pulp::Arch::new().dispatch(Correlate { x, kernels, bias, pads, y: &mut y });
    y
}

/// Arguments of a correlation; the crate pulp runs it with the widest vectors of the processor.
struct Correlate<'a> {
    x: &'a Volume,
    kernels: &'a Kernels,
    bias: &'a [f32],
    pads: [usize; 3],
    y: &'a mut Volume,
}

impl NullaryFnOnce for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        if self.kernels.tile == TILE {
            self.run::<TILE>();
        } else {
            self.run::<1>();
        }
    }
}

/// The taps of a kernel along one axis that lie within the input, for one output position.
#[derive(Clone, Copy)]
struct Reach {
    /// First tap that lies within the input.
    first: usize,
    count: usize,
    /// Input position of the first tap that lies within the input.
    input: usize,
}

impl Reach {
    #[inline(always)]
    fn new(at: usize, pad: usize, length: usize) -> Self {
        let first = pad.saturating_sub(at);
        let end = KERNEL.min(length + pad - at);
        Self { first, count: end - first, input: at + first - pad }
    }
}

impl Correlate<'_> {
    #[inline(always)]
    fn run<const T: usize>(&mut self) {
        let [_, rows, columns] = self.x.size;
        let [out_steps, out_rows, out_columns] = self.y.size;
        let out_places = product(self.y.size);
        let per_tile = self.kernels.inputs * TAPS * T;
        for (tile, bias) in self.bias.as_chunks::<T>().0.iter().enumerate() {
            let kernels = &self.kernels.values[tile * per_tile..(tile + 1) * per_tile];
            let mut at = 0;
            for step in 0..out_steps {
                let in_step = Reach::new(step, self.pads[0], self.x.size[0]);
                for row in 0..out_rows {
                    let in_row = Reach::new(row, self.pads[1], rows);
                    for column in 0..out_columns {
                        let in_column = Reach::new(column, self.pads[2], columns);
                        let reach = [in_step, in_row, in_column];
                        let start: [Lanes; T] = bias.map(|bias| [bias; LANES]);
                        let sums = match in_column.count {
                            1 => self.sums::<T, 1>(kernels, reach, start),
                            2 => self.sums::<T, 2>(kernels, reach, start),
                            _ => self.sums::<T, KERNEL>(kernels, reach, start),
                        };
                        for (output, sums) in sums.iter().enumerate() {
                            self.y.values[(tile * T + output) * out_places + at] = *sums;
                        }
                        at += 1;
                    }
                }
            }
        }
    }

    /// Returns the sums of `T` output channels at one position, where `C` kernel columns lie within
    /// the input.
    #[inline(always)]
    fn sums<const T: usize, const C: usize>(
        &self,
        kernels: &[f32],
        [step, row, column]: [Reach; 3],
        mut sums: [Lanes; T],
    ) -> [Lanes; T] {
        let [_, rows, columns] = self.x.size;
        let inputs = self.x.values.chunks_exact(product(self.x.size));
        for (x, w) in inputs.zip(kernels.chunks_exact(TAPS * T)) {
            for t in 0..step.count {
                for r in 0..row.count {
                    let place = (step.input + t) * rows + row.input + r;
                    let tap = (step.first + t) * KERNEL + row.first + r;
                    let x = x[place * columns + column.input..].first_chunk::<C>();
                    let w = w[(tap * KERNEL + column.first) * T..]
                        .as_chunks::<T>()
                        .0
                        .first_chunk::<C>();
                    if let (Some(x), Some(w)) = (x, w) {
                        for c in 0..C {
                            for output in 0..T {
                                add_scaled(&mut sums[output], w[c][output], &x[c]);
                            }
                        }
                    }
                }
            }
        }
        sums
    }
}

/// Returns, for each channel a of `small`, each channel b of `large` and each tap k, the sum over
/// all positions and windows of small\[a\]\[at\] large\[b\]\[at + k\].
///
/// # Panics
/// Unless `small` has a multiple of 4 channels, and each axis of `large` is longer than the axis of
/// `small` by the kernel's length minus 1.
fn weight_gradient(small: &Volume, large: &Volume) -> Vec<f32> {
    assert!(small.channels.is_multiple_of(TILE), "a multiple of {TILE} channels");
    for axis in 0..3 {
        assert_eq!(large.size[axis], small.size[axis] + KERNEL - 1, "axis {axis}");
    }
    let mut gradient = vec![0.0; small.channels * large.channels * TAPS];
    pulp::Arch::new().dispatch(WeightGradient { small, large, gradient: &mut gradient });
    gradient
}

/// Arguments of a weight gradient; the crate pulp runs it with the widest vectors of the processor.
struct WeightGradient<'a> {
    small: &'a Volume,
    large: &'a Volume,
    gradient: &'a mut [f32],
}

impl WithSimd for WeightGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (small, _) = S::as_simd_f32s(self.small.values.as_flattened());
        let (large, _) = S::as_simd_f32s(self.large.values.as_flattened());
        let [_, rows, columns] = self.large.size;
        let parts = LANES / S::F32_LANES;
        let small_places = product(self.small.size) * parts;
        let large_places = product(self.large.size) * parts;
        let per_tile = TILE * self.large.channels * TAPS;
        let tiles = small.chunks_exact(TILE * small_places);
        for (small, gradient) in tiles.zip(self.gradient.chunks_exact_mut(per_tile)) {
            for (b, large) in large.chunks_exact(large_places).enumerate() {
                for tap in 0..KERNEL * KERNEL {
                    let first = (tap / KERNEL * rows + tap % KERNEL) * columns * parts;
                    let mut sums = [[[0.0; LANES]; KERNEL]; TILE];
                    for part in 0..parts {
                        let vectors = Vectors {
                            small: &small[part..],
                            small_size: self.small.size,
                            large: &large[first + part..],
                            large_size: self.large.size,
                            parts,
                        };
                        let part_sums = vectors.sums(simd);
                        for (lanes, sum) in
                            sums.iter_mut().flatten().zip(part_sums.into_iter().flatten())
                        {
                            S::as_mut_simd_f32s(lanes).0[part] = sum;
                        }
                    }
                    for (a, sums) in sums.iter().enumerate() {
                        for (k, lanes) in sums.iter().enumerate() {
                            let at = (a * self.large.channels + b) * TAPS + tap * KERNEL + k;
                            gradient[at] = total(lanes);
                        }
                    }
                }
            }
        }
    }
}

/// The channels of a tile of `small` and one channel of `large`, as vectors that each hold some
/// windows of a group. `large` is shifted by the step and the row of a kernel tap.
struct Vectors<'a, V> {
    small: &'a [V],
    small_size: [usize; 3],
    large: &'a [V],
    large_size: [usize; 3],
    /// Number of vectors that together hold one value of every window in a group.
    parts: usize,
}

impl<V: Copy> Vectors<'_, V> {
    /// Returns, for each channel of a tile and each column of the kernel, the sum over all
    /// positions of the products of both volumes.
    #[inline(always)]
    fn sums<S: Simd<f32s = V>>(&self, simd: S) -> [[V; KERNEL]; TILE] {
        let [steps, rows, columns] = self.small_size;
        let places = steps * rows * columns;
        let mut sums = [[simd.splat_f32s(0.0); KERNEL]; TILE];
        for step in 0..steps {
            for row in 0..rows {
                let at = (step * rows + row) * columns;
                let place = (step * self.large_size[1] + row) * self.large_size[2];
                for column in 0..columns {
                    let x: [V; KERNEL] =
                        std::array::from_fn(|k| self.large[(place + column + k) * self.parts]);
                    for (a, sums) in sums.iter_mut().enumerate() {
                        let y = self.small[(a * places + at + column) * self.parts];
                        for (sum, x) in sums.iter_mut().zip(x) {
                            *sum = simd.mul_add_f32s(y, x, *sum);
                        }
                    }
                }
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIZE: [usize; 3] = [4, 5, 3];
    const CHANNELS: [usize; 2] = [2, 4];

    fn numbers(seed: u64, count: usize) -> Vec<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    fn volume(seed: u64, channels: usize, size: [usize; 3]) -> Volume {
        let count = channels * size.iter().product::<usize>();
        let values = numbers(seed, count * LANES);
        Volume::from_values(channels, size, values.as_chunks().0.to_vec())
    }

    /// Returns the inner product of two volumes of the same size.
    fn inner(a: &Volume, b: &Volume) -> f64 {
        assert_eq!(a.size, b.size);
        let values = a.values.as_flattened().iter();
        let pairs = values.zip(b.values.as_flattened());
        pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    }

    /// A linear map A and its gradient are adjoint: `<g, A x> = <A^T g, x>`. The map is also linear
    /// in its kernels, so the inner product of the kernels with their gradient has the same value.
    #[test]
    fn gradients_are_adjoint_to_both_convolutions_with_every_padding() {
        let weight = numbers(4, CHANNELS[0] * CHANNELS[1] * TAPS);
        let zeros = [0.0; 4];
        let along = |gradient: &parameters::Layer| -> f64 {
            let pairs = gradient.weight.iter().zip(&weight);
            pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-4 * (1.0 + a.abs()), "{a} {b}");
        for pads in [[0, 0, 0], [0, 1, 1], [1, 1, 1]] {
            let layer = Layer { weight: &weight, bias: &zeros[..CHANNELS[1]], pads };
            let x = volume(5, CHANNELS[0], SIZE);
            let y = layer.convolve(&x);
            let gradient = volume(6, CHANNELS[1], y.size);
            let product = inner(&gradient, &y);
            near(product, inner(&layer.convolve_gradient(CHANNELS[0], &gradient), &x));
            near(product, along(&layer.parameter_gradient(&x, &gradient)));

            // A transposed convolution maps the channels of the kernels' first index to the
            // channels of their second index.
            let layer = Layer { bias: &zeros[..CHANNELS[0]], ..layer };
            let x = volume(7, CHANNELS[1], SIZE);
            let y = layer.convolve_transposed(&x);
            assert_eq!(y.channels, CHANNELS[0]);
            let gradient = volume(8, CHANNELS[0], y.size);
            let product = inner(&gradient, &y);
            let at_input = layer.convolve_transposed_gradient(CHANNELS[1], &gradient);
            near(product, inner(&at_input, &x));
            near(product, along(&layer.transposed_parameter_gradient(&x, &gradient)));
        }
    }
}
