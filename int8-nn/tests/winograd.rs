//! Winograd's convolution and pool against the direct ones, number for number.

use int8_nn::{Conv3d, Pair, PlaneShape, Winograd, unscaled};
use proptest::prelude::*;

const PAIRS: usize = 8;
const CHANNELS: usize = 2 * PAIRS;

/// Values at the ends of their ranges as often as in between.
fn extreme<T: Clone + std::fmt::Debug + 'static>(
    low: T,
    high: T,
    any: impl Strategy<Value = T>,
) -> impl Strategy<Value = T> {
    prop_oneof![1 => Just(low), 1 => Just(high), 2 => any]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn every_pooled_sum_is_that_of_the_direct_convolution(
        (tile_rows, tile_columns, pairs, weights, planes) in (1_usize..4, 1_usize..3, 1_usize..4)
            .prop_flat_map(|(rows, columns, pairs)| {
                let weights = 27 * CHANNELS * 2 * pairs;
                let plane = (2 * rows + 2) * (4 * columns + 2) * CHANNELS;
                (
                    Just(rows),
                    Just(columns),
                    Just(pairs),
                    prop::collection::vec(extreme(-127_i8, 127, any::<i8>()), weights),
                    prop::collection::vec(prop::collection::vec(extreme(0_u8, 255, any::<u8>()), plane), 4),
                )
            }),
    ) {
        let outputs = 2 * pairs;
        let direct = Conv3d {
            input: PlaneShape {
                rows: 2 * tile_rows + 2,
                columns: 4 * tile_columns + 2,
                channels: CHANNELS,
            },
            output_channels: outputs,
            weights: &weights,
            bias: &vec![0; outputs],
        };
        let mut expected = [vec![0; direct.output().len()], vec![0; direct.output().len()]];
        for (later, sums) in expected.iter_mut().enumerate() {
            let [a, b, c] = std::array::from_fn(|age| &planes[later + age][..]);
            direct.plane([a, b, c], sums);
        }

        let mut winograd = Winograd::<PAIRS> { tile_rows, tile_columns, outputs, weights: &[] };
        let mut transformed_weights = vec![Pair::ZERO; winograd.weights_len()];
        Winograd::<PAIRS>::transform_weights(outputs, &weights, &mut transformed_weights);
        winograd.weights = &transformed_weights;
        prop_assert!(winograd.is_consistent(direct.input, direct.output().pooled()));
        let transformed: Vec<Vec<Pair>> = planes
            .iter()
            .map(|plane| {
                let pair = |&[a, b]: &[u8; 2]| Pair::new([a.into(), b.into()]);
                let plane: Vec<Pair> = plane.as_chunks().0.iter().map(pair).collect();
                let mut transformed = vec![Pair::ZERO; winograd.transformed_len()];
                winograd.transform(&plane, &mut transformed);
                transformed
            })
            .collect();
        let mut largest = vec![i32::MIN; winograd.pooled().len()];
        for later in 0..2 {
            let [a, b, c] = std::array::from_fn(|age| &transformed[later + age][..]);
            winograd.pool([a, b, c], &mut largest);
        }

        let shape = direct.output();
        for (at, &sum) in largest.iter().enumerate() {
            let (position, output) = (at / outputs, at % outputs);
            let (row, column) = (position / winograd.pooled().columns, position % winograd.pooled().columns);
            let window = [(0, 0), (0, 1), (1, 0), (1, 1)]
                .map(|(y, x)| shape.at(2 * row + y, 2 * column + x) + output);
            let most = expected.iter().flat_map(|sums| window.map(|at| sums[at])).max();
            prop_assert_eq!(Some(unscaled(sum)), most);
        }
    }
}
