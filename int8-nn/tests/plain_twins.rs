//! Every kernel against a twin in the most literal loops, over shapes, extremes and rails.

use int8_nn::{Conv3d, Linear, PlaneShape, max_pool, requantise, requantise_plane, saturate_u8};
use proptest::prelude::*;

fn shape() -> impl Strategy<Value = PlaneShape> {
    (3_usize..7, 3_usize..7, 1_usize..5).prop_map(|(rows, columns, channels)| PlaneShape {
        rows,
        columns,
        channels,
    })
}

/// A byte, often at a rail.
fn extreme() -> impl Strategy<Value = u8> {
    prop_oneof![4 => any::<u8>(), 1 => Just(0), 1 => Just(127), 1 => Just(128), 1 => Just(255)]
}

fn bytes(length: usize) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(extreme(), length)
}

fn signed(bytes: &[u8]) -> Vec<i8> {
    bytes.iter().map(|b| b.cast_signed()).collect()
}

#[derive(Debug, Clone)]
struct ConvCase {
    input: PlaneShape,
    outputs: usize,
    weights: Vec<i8>,
    bias: Vec<i32>,
    planes: [Vec<u8>; 3],
}

fn conv_case() -> impl Strategy<Value = ConvCase> {
    (shape(), 1_usize..6).prop_flat_map(|(input, outputs)| {
        let bias = prop::collection::vec(-1_000_000..1_000_000, outputs);
        let plane = || bytes(input.len());
        (
            bytes(27 * input.channels * outputs),
            bias,
            [plane(), plane(), plane()],
        )
            .prop_map(move |(weights, bias, planes)| ConvCase {
                input,
                outputs,
                weights: signed(&weights),
                bias,
                planes,
            })
    })
}

impl ConvCase {
    /// One output accumulator, one product after the other.
    fn literal(&self, row: usize, column: usize, output: usize) -> i32 {
        let mut sum = self.bias[output];
        for (time, plane) in self.planes.iter().enumerate() {
            for tap_row in 0..3 {
                for tap_column in 0..3 {
                    for channel in 0..self.input.channels {
                        let tap = (time * 3 + tap_row) * 3 + tap_column;
                        let weight = (tap * self.input.channels + channel) * self.outputs + output;
                        let x = ((row + tap_row) * self.input.columns + column + tap_column)
                            * self.input.channels
                            + channel;
                        sum += i32::from(self.weights[weight]) * i32::from(plane[x]);
                    }
                }
            }
        }
        sum
    }
}

proptest! {
    #[test]
    fn a_convolution_is_the_sum_of_its_taps(case in conv_case()) {
        let conv = Conv3d {
            input: case.input,
            output_channels: case.outputs,
            weights: &case.weights,
            bias: &case.bias,
        };
        let output = conv.output();
        prop_assert!(conv.is_consistent(case.input, output));
        let mut sums = vec![0; output.len()];
        conv.plane(case.planes.each_ref().map(|plane| &plane[..]), &mut sums);
        for row in 0..output.rows {
            for column in 0..output.columns {
                for channel in 0..case.outputs {
                    let sum = sums[output.at(row, column) + channel];
                    prop_assert_eq!(sum, case.literal(row, column, channel));
                }
            }
        }
    }

    #[test]
    fn accumulating_in_pieces_equals_one_matrix_product(
        (split, inputs, weights) in (1_usize..40).prop_flat_map(|inputs| {
            (0..=inputs, bytes(inputs), bytes(inputs * 7))
        })
    ) {
        let (inputs, weights) = (signed(&inputs), signed(&weights));
        let mut sums = [11; 7];
        let (first, second) = weights.split_at(split * 7);
        Linear { outputs: 7, weights: first }.accumulate(&inputs[..split], &mut sums);
        Linear { outputs: 7, weights: second }.accumulate(&inputs[split..], &mut sums);
        for (output, sum) in sums.iter().enumerate() {
            let literal: i32 = inputs
                .iter()
                .enumerate()
                .map(|(k, &x)| i32::from(x) * i32::from(weights[k * 7 + output]))
                .sum();
            prop_assert_eq!(*sum, 11 + literal);
        }
    }

    #[test]
    fn pooling_accumulators_equals_pooling_activations(
        (shape, sums, factors) in (2_usize..7, 2_usize..7, 1_usize..5)
            .prop_map(|(rows, columns, channels)| PlaneShape { rows, columns, channels })
            .prop_flat_map(|shape| {
                let sums = prop::collection::vec(any::<i32>(), 2 * shape.len());
                (Just(shape), sums, prop::collection::vec(any::<i32>(), shape.channels))
            })
    ) {
        let (earlier, later) = sums.split_at(shape.len());
        let output = shape.pooled();
        let mut pooled = vec![0; output.len()];
        max_pool(shape, [earlier, later], &factors, &mut pooled);

        for row in 0..output.rows {
            for column in 0..output.columns {
                for (channel, &factor) in factors.iter().enumerate() {
                    let activations = [earlier, later].into_iter().flat_map(|plane| {
                        (0..4).map(move |k| {
                            let at = shape.at(2 * row + k / 2, 2 * column + k % 2);
                            saturate_u8(requantise(plane[at + channel], factor))
                        })
                    });
                    // A negative factor stands for negated weights: the minimum is wanted.
                    let literal = if factor < 0 { activations.min() } else { activations.max() };
                    prop_assert_eq!(Some(pooled[output.at(row, column) + channel]), literal);
                }
            }
        }
    }

    #[test]
    fn a_plane_is_requantised_element_by_element(
        sums in prop::collection::vec(any::<i32>(), 12),
        factors in prop::array::uniform3(any::<i32>()),
    ) {
        let mut plane = [0; 12];
        requantise_plane(&sums, &factors, &mut plane);
        for (k, out) in plane.iter().enumerate() {
            let exact = i128::from(sums[k]) * i128::from(factors[k % 3]);
            let rounded = (exact + (1 << 31)).div_euclid(1 << 32);
            prop_assert_eq!(i128::from(*out), rounded.clamp(0, 255));
        }
    }
}
