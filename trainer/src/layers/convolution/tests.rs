//! Tests against plain loops over the definition of a convolution.

use super::*;
use crate::layers::LANES;
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

/// Returns the convolution of one window by its definition: \[output\]\[step\]\[row\]\[column\].
fn plain(x: &Volume, layer: &Layer<'_>, lane: usize) -> Vec<f64> {
    let [steps, rows, columns] = x.size;
    let out = [0, 1, 2].map(|axis| x.size[axis] + 2 * layer.pads[axis] - 2);
    let mut y = Vec::new();
    for (output, bias) in layer.bias.iter().enumerate() {
        for at in 0..out.iter().product() {
            let at = [at / (out[1] * out[2]), at / out[2] % out[1], at % out[2]];
            let mut sum = f64::from(*bias);
            for input in 0..x.channels {
                for tap in 0..TAPS {
                    let tap_at = [tap / 9, tap / 3 % 3, tap % 3];
                    // An index below 0 wraps around, beyond every size.
                    let [t, r, c] = [0, 1, 2]
                        .map(|axis| (at[axis] + tap_at[axis]).wrapping_sub(layer.pads[axis]));
                    if t < steps && r < rows && c < columns {
                        let x = x.values[((input * steps + t) * rows + r) * columns + c][lane];
                        let w = layer.weight[(output * x_channels(layer) + input) * TAPS + tap];
                        sum += f64::from(x) * f64::from(w);
                    }
                }
            }
            y.push(sum);
        }
    }
    y
}

fn x_channels(layer: &Layer<'_>) -> usize {
    layer.weight.len() / TAPS / layer.bias.len()
}

/// Returns the inner product of two volumes of the same size.
fn inner(a: &Volume, b: &Volume) -> f64 {
    assert_eq!(a.size, b.size);
    let values = a.values.as_flattened().iter();
    let pairs = values.zip(b.values.as_flattened());
    pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

#[test]
fn a_convolution_is_the_sum_of_its_definition_with_every_padding() {
    let weight = numbers(1, CHANNELS[0] * CHANNELS[1] * TAPS);
    let bias = numbers(2, CHANNELS[1]);
    let x = volume(3, CHANNELS[0], SIZE);
    for pads in [[0, 0, 0], [0, 1, 1], [1, 1, 1]] {
        let layer = Layer {
            weight: &weight,
            bias: &bias,
            pads,
        };
        let y = layer.convolve(&x);
        for lane in [0, 7, LANES - 1] {
            for (value, expected) in y.values.iter().zip(plain(&x, &layer, lane)) {
                assert!((f64::from(value[lane]) - expected).abs() < 1e-5, "{pads:?}");
            }
        }
    }
}

/// A linear map and its gradient are adjoint: `<g, A x> = <A^T g, x>`. The same inner product is that of the
/// kernels with their gradient, because the map is also linear in the kernels.
#[test]
fn gradients_are_adjoint_to_both_convolutions_with_every_padding() {
    let weight = numbers(4, CHANNELS[0] * CHANNELS[1] * TAPS);
    let zeros = [0.0; 4];
    let along = |gradient: &LayerGradient| -> f64 {
        let pairs = gradient.weight.iter().zip(&weight);
        pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-4 * (1.0 + a.abs()), "{a} {b}");
    for pads in [[0, 0, 0], [0, 1, 1], [1, 1, 1]] {
        let layer = Layer {
            weight: &weight,
            bias: &zeros[..CHANNELS[1]],
            pads,
        };
        let x = volume(5, CHANNELS[0], SIZE);
        let y = layer.convolve(&x);
        let gradient = volume(6, CHANNELS[1], y.size);
        let product = inner(&gradient, &y);
        near(
            product,
            inner(&layer.convolve_gradient(CHANNELS[0], &gradient), &x),
        );
        near(product, along(&layer.parameter_gradient(&x, &gradient)));

        // As a transposed convolution, the kernels lead from their first index to their second.
        let layer = Layer {
            bias: &zeros[..CHANNELS[0]],
            ..layer
        };
        let x = volume(7, CHANNELS[1], SIZE);
        let y = layer.convolve_transposed(&x);
        assert_eq!(y.channels, CHANNELS[0]);
        let gradient = volume(8, CHANNELS[0], y.size);
        let product = inner(&gradient, &y);
        let at_input = layer.convolve_transposed_gradient(CHANNELS[1], &gradient);
        near(product, inner(&at_input, &x));
        near(
            product,
            along(&layer.transposed_parameter_gradient(&x, &gradient)),
        );
    }
}
