//! A convolution as it is written down, one plane at a time.

use crate::{
    Pair, PlaneShape,
    dot::{self, OUTPUTS, POSITIONS, dots},
};

/// Weights of an input and an output channel: (time, row, column).
const TAPS: usize = 27;
/// Most output channels: three positions of them fit any word.
const MOST_OUTPUTS: usize = 65_536;

/// A 3x3x3 convolution over (time, row, column), stride 1, unpadded, followed by a max-pool of any
/// shape: what [`Winograd`](crate::Winograd) computes where its tiles do not fit the pool, or its
/// transformed numbers not 16 bits. From 16 channels to 32 it takes 9,870 instructions for each
/// position, Winograd's 3,900 (simulated, Cortex-M4).
///
/// Ranges: inputs of 16 bits, as long as no sum of 27 products for each channel leaves 32.
///
/// `PAIRS` are the pairs of input channels, an even number (8 have assembler), `COLUMNS` the columns
/// of the input.
#[derive(Clone, Copy, Debug)]
pub struct Direct<'w, const PAIRS: usize, const COLUMNS: usize> {
    /// Rows and columns of which the pool keeps the largest.
    pub pool: [usize; 2],
    /// Shape of a pooled plane.
    pub pooled: PlaneShape,
    /// What [`Self::pack_weights`] makes, [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
}

impl<const PAIRS: usize, const COLUMNS: usize> Direct<'_, PAIRS, COLUMNS> {
    /// Shape of an input plane: the outputs that fill whole pools, and what they reach beyond them.
    pub const fn input(&self) -> PlaneShape {
        PlaneShape {
            rows: self.pooled.rows * self.pool[0] + 2,
            columns: COLUMNS,
            channels: 2 * PAIRS,
        }
    }

    /// Pairs in a plane that [`Self::transform`] has made.
    pub const fn transformed_len(&self) -> usize {
        self.input().rows * COLUMNS * PAIRS
    }

    /// Pairs in the packed weights of so many outputs.
    pub const fn weights_len(outputs: usize) -> usize {
        outputs * TAPS * PAIRS
    }

    /// True when this convolution fits between planes of these shapes and its weights have the
    /// length that this asks for; assert it in `const`.
    pub const fn is_consistent(&self, input: PlaneShape, pooled: PlaneShape) -> bool {
        self.input().equals(input)
            && self.pooled.equals(pooled)
            && !pooled.is_empty()
            && self.pool[0] > 0
            && COLUMNS == pooled.columns * self.pool[1] + 2
            && COLUMNS >= 2 + POSITIONS
            && pooled.channels.is_multiple_of(OUTPUTS)
            && pooled.channels <= MOST_OUTPUTS
            && self.weights.len() == Self::weights_len(pooled.channels)
    }

    /// Lays an input plane of shape [`Self::input`], `[pair of channels][row][column]`, out as the
    /// products read it: `[row][column][pair of channels]`.
    ///
    /// # Panics
    /// When a slice is shorter than its shape says.
    pub fn transform(&self, plane: &[Pair], transformed: &mut [Pair]) {
        let positions = self.input().rows * COLUMNS;
        let transformed = &mut transformed[..positions * PAIRS];
        for (pair, plane) in plane[..PAIRS * positions]
            .chunks_exact(positions)
            .enumerate()
        {
            for (place, &value) in transformed.chunks_exact_mut(PAIRS).zip(plane) {
                place[pair] = value;
            }
        }
    }

    /// The plane of outputs that ends with the last of three planes as [`Self::transform`] makes
    /// them, oldest first: where the largest output of a pool window exceeds what `largest`, of shape
    /// [`Self::pooled`], holds, it takes its place. Without bias.
    ///
    /// # Panics
    /// When a slice is shorter than its shape says, or shapes and weights do not fit each other:
    /// [`Self::is_consistent`].
    pub fn pool(&self, transformed: [&[Pair]; 3], largest: &mut [i32]) {
        assert!(
            self.is_consistent(self.input(), self.pooled),
            "whole pools, whole pairs of outputs and as many weights"
        );
        let largest = &mut largest[..self.pooled.len()];
        let (rows, columns) = (self.pooled.rows * self.pool[0], COLUMNS - 2);
        let weights = self.weights.chunks_exact(dot::weights_len(TAPS * PAIRS));
        for row in 0..rows {
            for group in 0..columns.div_ceil(POSITIONS) {
                // The last group starts so early that it is full; a maximum may be taken twice.
                let column = (group * POSITIONS).min(columns - POSITIONS);
                for (pair, weights) in weights.clone().enumerate() {
                    let sums = Self::dots(transformed, [row, column], weights);
                    self.keep_largest(&sums, [row, column, pair], largest);
                }
            }
        }
    }

    /// The sums of a pair of outputs at three positions from (row, column) on.
    #[inline]
    fn dots(
        transformed: [&[Pair]; 3],
        [row, column]: [usize; 2],
        weights: &[Pair],
    ) -> [i32; POSITIONS * OUTPUTS] {
        let input = |plane: usize, row: usize, column: usize| {
            &transformed[plane][(row * COLUMNS + column) * PAIRS..]
        };
        let mut sums = [[0; POSITIONS * OUTPUTS]];
        if PAIRS == 8 {
            // Three columns of a row lie side by side.
            let rows = core::array::from_fn(|row_of| input(row_of / 3, row + row_of % 3, column));
            dots::<{ TAPS / 3 }, 24, 8>(rows, weights, &mut sums);
        } else {
            let taps =
                core::array::from_fn(|tap| input(tap / 9, row + tap / 3 % 3, column + tap % 3));
            dots::<TAPS, PAIRS, PAIRS>(taps, weights, &mut sums);
        }
        sums[0]
    }

    /// Keeps the sums of a pair of outputs at three positions from (row, column) on where they are
    /// the largest of their pool.
    #[inline]
    fn keep_largest(
        &self,
        sums: &[i32; POSITIONS * OUTPUTS],
        [row, column, pair]: [usize; 3],
        largest: &mut [i32],
    ) {
        let row = row / self.pool[0] * self.pooled.columns;
        for (position, sums) in sums.as_chunks::<OUTPUTS>().0.iter().enumerate() {
            let place = row + (column + position) / self.pool[1];
            let first = place * self.pooled.channels + pair * OUTPUTS;
            for (largest, &sum) in largest[first..].iter_mut().zip(sums) {
                *largest = sum.max(*largest);
            }
        }
    }

    /// A sum of [`Self::pool`] as the convolution has it: the same.
    #[inline]
    pub const fn unscaled(sum: i32) -> i32 {
        sum
    }

    /// Orders weights `[time][row][column][input][output]` as [`Self::weights`] holds them.
    ///
    /// # Panics
    /// When the slices do not have 54 * `PAIRS` * `outputs` and [`Self::weights_len`] numbers.
    pub fn pack_weights(outputs: usize, weights: &[i8], packed: &mut [Pair]) {
        let channels = 2 * PAIRS;
        assert_eq!(weights.len(), TAPS * channels * outputs, "27 taps each");
        let step = dot::weights_len(TAPS * PAIRS);
        for (at, &weight) in weights.iter().enumerate() {
            let (input, output) = (at / outputs, at % outputs);
            let place = dot::weight_at(output % OUTPUTS, input / 2);
            let pair = &mut packed[output / OUTPUTS * step + place];
            *pair = pair.with(input % 2, weight.into());
        }
    }
}
