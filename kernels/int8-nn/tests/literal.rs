//! Tests that every kernel equals plain loops over single products, for many shapes and for extreme
//! values.

use int8_nn::{Direct, InputConv, Linear, Pair, PlaneShape, Winograd, requantise, saturate_u8};
use proptest::prelude::*;

const PAIRS: usize = 8;

/// Returns the largest input of Winograd's convolution. It is above 255, because networks with
/// padding add an offset to all inputs so that padding is not negative.
fn largest_input() -> i16 {
    i16::try_from(Winograd::<PAIRS, 6>::LARGEST_INPUT).expect("16 bits")
}

/// Draws weights in -127..=127, half of them at the ends of the range.
fn weights(length: usize) -> impl Strategy<Value = Vec<i8>> {
    let weight = prop_oneof![Just(-127_i8), Just(127), -127_i8..=127, -127_i8..=127];
    prop::collection::vec(weight, length)
}

fn inputs(low: i16, high: i16, length: usize) -> impl Strategy<Value = Vec<i16>> {
    let input = prop_oneof![Just(low), Just(high), low..=high, low..=high];
    prop::collection::vec(input, length)
}

/// Reorders a plane from `[row][column][channel]` to `[pair of channels][row][column]`, the order
/// of planes between convolutions.
fn by_pair(plane: &[i16], channels: usize) -> Vec<Pair> {
    let positions = plane.len() / channels;
    (0..channels / 2 * positions)
        .map(|at| {
            let first = at % positions * channels + at / positions * 2;
            Pair::new([plane[first], plane[first + 1]])
        })
        .collect()
}

/// Returns the index of a position's first channel in a plane `[row][column][channel]`.
fn at(shape: PlaneShape, row: usize, column: usize) -> usize {
    (row * shape.columns + column) * shape.channels
}

fn paired(numbers: &[i16]) -> Vec<Pair> {
    let mut pairs = vec![Pair::ZERO; numbers.len().div_ceil(2)];
    Pair::fill(&mut pairs, numbers.iter().copied());
    pairs
}

/// Returns one output of a 3x3x3 convolution, computed product by product; weights are
/// `[time][row][column][input][output]`.
fn convolved(
    shape: PlaneShape,
    planes: [&[i16]; 3],
    weights: &[i8],
    outputs: usize,
    [row, column, output]: [usize; 3],
) -> i32 {
    let mut sum = 0;
    for (time, plane) in planes.into_iter().enumerate() {
        for tap_row in 0..3 {
            for tap_column in 0..3 {
                for channel in 0..shape.channels {
                    let tap = (time * 3 + tap_row) * 3 + tap_column;
                    let weight = weights[(tap * shape.channels + channel) * outputs + output];
                    let x = plane[at(shape, row + tap_row, column + tap_column) + channel];
                    sum += i32::from(weight) * i32::from(x);
                }
            }
        }
    }
    sum
}

/// A convolution with a max-pool, and as many input planes as one pool needs: two more than the
/// pool has steps.
#[derive(Clone, Debug)]
struct Case {
    /// Steps, rows and columns of the max-pool.
    pool: [usize; 3],
    pooled: PlaneShape,
    weights: Vec<i8>,
    planes: Vec<Vec<i16>>,
}

/// Draws a random convolution whose max-pooled output has one to three rows and one to three pairs
/// of channels. Its inputs are from `low` to `high`.
fn case(
    pairs: usize,
    columns: usize,
    pool: impl Strategy<Value = [usize; 3]>,
    [low, high]: [i16; 2],
) -> impl Strategy<Value = Case> {
    (pool, 1_usize..4, 1_usize..4).prop_flat_map(move |(pool, rows, outputs)| {
        let pooled = PlaneShape { rows, columns: (columns - 2) / pool[2], channels: 2 * outputs };
        let plane = inputs(low, high, (rows * pool[1] + 2) * columns * 2 * pairs);
        let planes = prop::collection::vec(plane, pool[0] + 2);
        let weights = weights(27 * 2 * pairs * pooled.channels);
        (weights, planes).prop_map(move |(weights, planes)| Case { pool, pooled, weights, planes })
    })
}

fn winograd_case(columns: usize) -> impl Strategy<Value = Case> {
    case(PAIRS, columns, Just([2, 2, 2]), [0, largest_input()])
}

/// Draws a convolution whose max-pool spans one time step and has any width that divides the number
/// of output columns; inputs exceed 8 bits.
fn direct_case(pairs: usize, columns: usize) -> impl Strategy<Value = Case> {
    let widths = (1..=columns - 2).filter(|width| (columns - 2).is_multiple_of(*width));
    let width = prop::sample::select(widths.collect::<Vec<_>>());
    let pool = (1_usize..4, width).prop_map(|(height, width)| [1, height, width]);
    case(pairs, columns, pool, [-1_000, 1_000])
}

impl Case {
    /// Returns the planes, each transformed by `transform`, a method of the kernel that fills
    /// `length` pairs.
    fn transformed(
        &self,
        input: PlaneShape,
        length: usize,
        transform: impl Fn(&[Pair], &mut [Pair]),
    ) -> Vec<Vec<Pair>> {
        let planes = self.planes.iter().map(|plane| {
            let mut transformed = vec![Pair::ZERO; length];
            transform(&by_pair(plane, input.channels), &mut transformed);
            transformed
        });
        planes.collect()
    }

    /// Returns the pooled sums in the order `[row][column][output]`, computed product by product.
    fn pooled_sums(&self, input: PlaneShape) -> Vec<i32> {
        let [steps, rows, columns] = self.pool;
        let outputs = self.pooled.channels;
        let sums = (0..self.pooled.len()).map(|index| {
            let (position, output) = (index / outputs, index % outputs);
            let first =
                [position / self.pooled.columns * rows, position % self.pooled.columns * columns];
            let window = (0..steps * rows * columns).map(|k| {
                let planes = std::array::from_fn(|age| &self.planes[k / rows / columns + age][..]);
                let place = [first[0] + k / columns % rows, first[1] + k % columns, output];
                convolved(input, planes, &self.weights, outputs, place)
            });
            window.max().expect("a pool has positions")
        });
        sums.collect()
    }
}

/// Asserts that Winograd's pooled sums equal the sums of plain loops.
fn compare<const COLUMNS: usize>(case: &Case) -> Result<(), TestCaseError> {
    let outputs = case.pooled.channels;
    let mut weights = vec![Pair::ZERO; Winograd::<PAIRS, COLUMNS>::weights_len(outputs)];
    Winograd::<PAIRS, COLUMNS>::transform_weights(outputs, &case.weights, &mut weights);
    let conv =
        Winograd::<PAIRS, COLUMNS> { tile_rows: case.pooled.rows, outputs, weights: &weights };
    let input = conv.input();
    prop_assert!(conv.is_consistent(input, case.pooled));
    let transformed = case.transformed(input, conv.transformed_len(), |plane, out| {
        conv.transform(plane, out);
    });
    let mut largest = vec![i32::MIN; case.pooled.len()];
    for later in 0..2 {
        let planes = std::array::from_fn(|age| &transformed[later + age][..]);
        conv.convolve_max_pool(planes, &mut largest);
    }
    let unscaled = largest.into_iter().map(Winograd::<PAIRS, COLUMNS>::unscaled);
    prop_assert_eq!(unscaled.collect::<Vec<_>>(), case.pooled_sums(input));
    Ok(())
}

/// Asserts that the direct kernel's pooled sums equal the sums of plain loops.
fn compare_direct<const PAIRS: usize, const COLUMNS: usize>(
    case: &Case,
) -> Result<(), TestCaseError> {
    let outputs = case.pooled.channels;
    let mut weights = vec![Pair::ZERO; Direct::<PAIRS, COLUMNS>::weights_len(outputs)];
    Direct::<PAIRS, COLUMNS>::pack_weights(outputs, &case.weights, &mut weights);
    let conv = Direct::<PAIRS, COLUMNS> {
        pool: [case.pool[1], case.pool[2]],
        pooled: case.pooled,
        weights: &weights,
    };
    let input = conv.input();
    prop_assert!(conv.is_consistent(input, case.pooled));
    let transformed = case.transformed(input, conv.transformed_len(), |plane, out| {
        conv.transform(plane, out);
    });
    let mut largest = vec![i32::MIN; case.pooled.len()];
    let planes = std::array::from_fn(|age| &transformed[age][..]);
    conv.convolve_max_pool(planes, &mut largest);
    prop_assert_eq!(largest, case.pooled_sums(input));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn the_direct_kernel_s_pooled_sums_equal_those_of_plain_loops(
        ours in direct_case(8, 6),
        widest in direct_case(8, 11),
        fewer_channels in direct_case(2, 8),
    ) {
        compare_direct::<8, 6>(&ours)?;
        compare_direct::<8, 11>(&widest)?;
        compare_direct::<2, 8>(&fewer_channels)?;
    }

    #[test]
    fn winograd_s_pooled_sums_equal_those_of_plain_loops(
        narrow in winograd_case(6),
        wide in winograd_case(10),
    ) {
        compare::<6>(&narrow)?;
        compare::<10>(&wide)?;
    }

    #[test]
    fn the_input_convolution_equals_plain_loops(
        (rows, pairs, crop, weights, planes) in (3_usize..8, 1_usize..4, 0_usize..2)
            .prop_flat_map(|(rows, pairs, crop)| {
                let plane = || inputs(-128, 127, rows * 9);
                let weights = weights(27 * 2 * pairs);
                (Just(rows), Just(pairs), Just(crop), weights, [plane(), plane(), plane()])
            }),
        bias in -1_000_000..1_000_000,
        multiplier in 0..i32::MAX,
    ) {
        let outputs = 2 * pairs;
        let input = PlaneShape { rows, columns: 9, channels: 1 };
        let output = PlaneShape { rows: rows - 2, columns: 7 - crop, channels: outputs };
        let mut packed = vec![Pair::ZERO; InputConv::<9>::weights_len(outputs)];
        InputConv::<9>::pack_weights(outputs, &weights, &mut packed);
        let conv = InputConv::<9> {
            rows,
            output,
            weights: &packed,
            bias: &vec![bias; outputs],
            multipliers: &vec![multiplier; outputs],
        };
        prop_assert!(conv.is_consistent(input, output));
        let pairs_of = planes.each_ref().map(|plane| {
            let plane: Vec<i8> = plane.iter().map(|&x| i8::try_from(x).expect("8 bits")).collect();
            let mut pairs = vec![Pair::ZERO; plane.len()];
            conv.pair_up(&plane, &mut pairs);
            pairs
        });
        let (mut patches, mut sums) = (vec![Pair::ZERO; conv.patches_len()], vec![0; conv.sums_len()]);
        let mut found = vec![Pair::ZERO; output.len() / 2];
        conv.convolve(pairs_of.each_ref().map(|p| &p[..]), &mut patches, &mut sums, &mut found);
        for row in 0..output.rows {
            for column in 0..output.columns {
                for channel in 0..outputs {
                    let at = channel / 2 * output.rows * output.columns + row * output.columns + column;
                    let planes = planes.each_ref().map(|plane| &plane[..]);
                    let sum = convolved(input, planes, &weights, outputs, [row, column, channel]);
                    let expected = i16::from(saturate_u8(requantise(sum + bias, multiplier)));
                    prop_assert_eq!(found[at].get()[channel % 2], expected);
                }
            }
        }
    }

    #[test]
    fn a_linear_layer_adds_the_matrix_product_and_reads_its_weights_back(
        (eights, fours, missing, weights, x) in (1_usize..17, 1_usize..9, 0_usize..16)
            .prop_flat_map(|(eights, fours, missing)| {
                let weights = weights((16 * eights - missing) * 4 * fours);
                (Just(eights), Just(fours), Just(missing), weights, inputs(-128, 255, 16 * eights))
            }),
    ) {
        let (pairs, outputs) = (8 * eights, 4 * fours);
        let mut packed = vec![Pair::ZERO; pairs * outputs / 2];
        Linear::pack_weights(pairs, outputs, &weights, &mut packed);
        let layer = Linear { inputs: pairs, outputs, weights: &packed };
        prop_assert!(layer.is_consistent(pairs, outputs));
        let mut sums = vec![11; outputs];
        layer.accumulate(&paired(&x), &mut sums);
        for (output, &sum) in sums.iter().enumerate() {
            let product = |k: usize| i32::from(x[k]) * i32::from(weights[k * outputs + output]);
            let expected: i32 = (0..16 * eights - missing).map(product).sum();
            prop_assert_eq!(sum, 11 + expected);
        }
        // The same matrix, but input 12 gets the weights of input 3.
        let mut copied = packed.clone();
        layer.copy_input(3, &mut copied, pairs, 12);
        let copied = Linear { weights: &copied, ..layer };
        for (pair, output) in (0..pairs).flat_map(|pair| (0..outputs).map(move |o| (pair, o))) {
            let weight = |input| weights.get(input * outputs + output).copied().unwrap_or(0).into();
            let mut expected: [i16; 2] = [2 * pair, 2 * pair + 1].map(weight);
            prop_assert_eq!(layer.weights_from(pair, output).get(), expected);
            if pair == 6 {
                expected[0] = weight(3);
            }
            prop_assert_eq!(copied.weights_from(pair, output).get(), expected);
        }
        let outside = [layer.weights_from(pairs, 0), layer.weights_from(0, outputs)];
        prop_assert_eq!(outside, [Pair::ZERO; 2]);
    }

    #[test]
    fn requantising_rounds_half_up(sum in any::<i32>(), factor in any::<i32>()) {
        let exact = i128::from(sum) * i128::from(factor);
        let rounded = (exact + (1 << 31)).div_euclid(1 << 32);
        prop_assert_eq!(i128::from(requantise(sum, factor)), rounded);
    }
}

#[test]
fn no_sum_overflows_with_all_weights_and_inputs_at_the_ends_of_their_ranges() {
    for weight in [127, -127] {
        for input in [0, 255, largest_input()] {
            let case = Case {
                pool: [2, 2, 2],
                pooled: PlaneShape { rows: 3, columns: 2, channels: 2 },
                weights: vec![weight; 27 * 2 * PAIRS * 2],
                planes: vec![vec![input; 8 * 6 * 2 * PAIRS]; 4],
            };
            compare::<6>(&case).expect("the direct sum");
        }
        for input in [0, 255] {
            let weights = vec![weight; 256 * 4];
            let mut packed = vec![Pair::ZERO; 128 * 4 / 2];
            Linear::pack_weights(128, 4, &weights, &mut packed);
            let layer = Linear { inputs: 128, outputs: 4, weights: &packed };
            let mut sums = [0; 4];
            layer.accumulate(&paired(&[input; 256]), &mut sums);
            assert_eq!(sums, [256 * i32::from(input) * i32::from(weight); 4]);
        }
    }
}

#[test]
#[should_panic(expected = "whole rounds")]
fn a_matrix_with_an_incomplete_round_of_inputs_is_refused() {
    let layer = Linear { inputs: 2, outputs: 4, weights: &[Pair::ZERO; 4] };
    layer.accumulate(&[Pair::ZERO; 2], &mut [0; 4]);
}
