//! A direct convolution (without Winograd's transforms), one plane at a time.

#[cfg(not(smlad))]
use crate::octet::Kernel;
use crate::{
    dot::{self, OUTPUTS, POSITIONS, dots},
    octet::{self, Octet},
    pair::Pair,
    plane::PlaneShape,
};

/// Number of weights for each pair of input and output channel: 3 steps x 3 rows x 3 columns.
const TAPS: usize = 27;
/// Largest number of output channels. With more, byte offsets of three positions could exceed 32
/// bits.
const MAX_OUTPUTS: usize = 65_536;

/// A 3x3x3 convolution over (time, row, column), stride 1, unpadded, followed by a max-pool of any
/// shape.
///
/// This convolution is for networks whose pool does not fit the tiles of
/// [`Winograd`](crate::Winograd), or whose transformed numbers do not fit 16 bits. With 16 input
/// and 32 output channels it takes 9,870 instructions per output position; Winograd takes 3,900
/// (simulated, Cortex-M4).
///
/// Inputs have 16 bits. Each output sums 27 products for each input channel; the sum must fit 32
/// bits.
///
/// `PAIRS` is the number of pairs of input channels, an even number; there is an assembler kernel
/// for 8 pairs. `COLUMNS` is the number of columns of the input.
#[derive(Clone, Copy, Debug)]
pub struct Direct<'w, const PAIRS: usize, const COLUMNS: usize> {
    /// Numbers of rows and columns of a pool window.
    pub pool: [usize; 2],
    /// Shape of the plane after the pool.
    pub pooled: PlaneShape,
    /// Weights, packed by [`Self::pack_weights`]: [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
}

impl<const PAIRS: usize, const COLUMNS: usize> Direct<'_, PAIRS, COLUMNS> {
    /// Returns the shape of an input plane: the shape of the outputs before the pool, plus the two
    /// rows and two columns by which an unpadded convolution shrinks a plane.
    pub const fn input(&self) -> PlaneShape {
        PlaneShape {
            rows: self.pooled.rows * self.pool[0] + 2,
            columns: COLUMNS,
            channels: 2 * PAIRS,
        }
    }

    /// Returns the number of pairs in a plane written by [`Self::transform`].
    pub const fn transformed_len(&self) -> usize {
        self.input().rows * COLUMNS * PAIRS
    }

    /// Returns the number of pairs in the packed weights of `outputs` output channels.
    pub const fn weights_len(outputs: usize) -> usize {
        outputs * TAPS * PAIRS
    }

    /// Returns true if this convolution turns planes of shape `input` into planes of shape `pooled`
    /// and has the right number of weights. Callers should assert it in a `const` context.
    pub const fn is_consistent(&self, input: PlaneShape, pooled: PlaneShape) -> bool {
        self.input().equals(input)
            && self.pooled.equals(pooled)
            && !pooled.is_empty()
            && self.pool[0] > 0
            && COLUMNS == pooled.columns * self.pool[1] + 2
            && COLUMNS >= 2 + POSITIONS
            && pooled.channels.is_multiple_of(OUTPUTS)
            && pooled.channels <= MAX_OUTPUTS
            && self.weights.len() == Self::weights_len(pooled.channels)
    }

    /// Reorders an input plane of shape [`Self::input`] from `[pair of channels][row][column]` to
    /// the order in which the products read it, `[row][column][pair of channels]`.
    ///
    /// # Panics
    /// If a slice is shorter than its shape requires.
    pub fn transform(&self, plane: &[Pair], transformed: &mut [Pair]) {
        let positions = self.input().rows * COLUMNS;
        let transformed = &mut transformed[..positions * PAIRS];
        for (pair, plane) in plane[..PAIRS * positions].chunks_exact(positions).enumerate() {
            for (place, &value) in transformed.chunks_exact_mut(PAIRS).zip(plane) {
                place[pair] = value;
            }
        }
    }

    /// Convolves three planes, transformed by [`Self::transform`], oldest first, into one plane of
    /// outputs, and max-pools the outputs into `largest`, of shape [`Self::pooled`].
    ///
    /// `largest[i]` becomes the maximum of its previous value and the outputs of pool window `i`,
    /// so that consecutive calls also pool over time. No bias is added.
    ///
    /// # Panics
    /// If a slice is shorter than its shape requires, or [`Self::is_consistent`] is false.
    pub fn convolve_max_pool(&self, transformed: [&[Pair]; 3], largest: &mut [i32]) {
        assert!(
            self.is_consistent(self.input(), self.pooled),
            "the shapes and the number of weights are inconsistent"
        );
        let largest = &mut largest[..self.pooled.len()];
        #[cfg(smlad)]
        self.convolve_max_pool_with::<octet::Plain>(transformed, largest);
        #[cfg(not(smlad))]
        octet::run((self, transformed, largest));
    }

    /// Does what [`Self::convolve_max_pool`] does, with octets of type `O`.
    #[inline(always)]
    fn convolve_max_pool_with<O: Octet>(&self, transformed: [&[Pair]; 3], largest: &mut [i32]) {
        let (rows, columns) = (self.pooled.rows * self.pool[0], COLUMNS - 2);
        let weights = self.weights.chunks_exact(dot::weights_len(TAPS * PAIRS));
        for row in 0..rows {
            for group in 0..columns.div_ceil(POSITIONS) {
                // The last group of positions is moved back so that it is full. It computes some
                // outputs twice, which does not change their maxima.
                let column = (group * POSITIONS).min(columns - POSITIONS);
                for (pair, weights) in weights.clone().enumerate() {
                    let sums = Self::dots::<O>(transformed, [row, column], weights);
                    self.keep_largest(&sums, [row, column, pair], largest);
                }
            }
        }
    }

    /// Returns the sums of a pair of output channels at three adjacent positions of a row, the
    /// first of which is (row, column).
    #[inline(always)]
    fn dots<O: Octet>(
        transformed: [&[Pair]; 3],
        [row, column]: [usize; 2],
        weights: &[Pair],
    ) -> [i32; POSITIONS * OUTPUTS] {
        let input = |plane: usize, row: usize, column: usize| {
            &transformed[plane][(row * COLUMNS + column) * PAIRS..]
        };
        let mut sums = [[0; POSITIONS * OUTPUTS]];
        if PAIRS == 8 {
            // The inputs of three adjacent columns are contiguous in a row, so each of the nine
            // rows (three in each plane) is one segment.
            let rows = core::array::from_fn(|row_of| input(row_of / 3, row + row_of % 3, column));
            dots::<O, { TAPS / 3 }, 24, 8>(rows, weights, &mut sums);
        } else {
            let taps =
                core::array::from_fn(|tap| input(tap / 9, row + tap / 3 % 3, column + tap % 3));
            dots::<O, TAPS, PAIRS, PAIRS>(taps, weights, &mut sums);
        }
        sums[0]
    }

    /// Updates the maxima of the pool windows with the sums of a pair of output channels at three
    /// adjacent positions of a row, the first of which is (row, column).
    #[inline(always)]
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

    /// Returns a sum of [`Self::convolve_max_pool`] unchanged; exists so that callers can treat
    /// this convolution as they treat Winograd's, whose `unscaled` divides by 48.
    #[inline]
    pub const fn unscaled(sum: i32) -> i32 {
        sum
    }

    /// Packs weights `[time][row][column][input][output]` into the order of the field `weights`.
    ///
    /// # Panics
    /// If `weights` does not have 54 * `PAIRS` * `outputs` numbers, or `packed` is shorter than
    /// [`Self::weights_len`].
    pub fn pack_weights(outputs: usize, weights: &[i8], packed: &mut [Pair]) {
        let channels = 2 * PAIRS;
        assert_eq!(
            weights.len(),
            TAPS * channels * outputs,
            "27 weights for each input and output"
        );
        let step = dot::weights_len(TAPS * PAIRS);
        for (at, &weight) in weights.iter().enumerate() {
            let (input, output) = (at / outputs, at % outputs);
            let place = dot::weight_index(output % OUTPUTS, input / 2);
            let pair = &mut packed[output / OUTPUTS * step + place];
            *pair = pair.with(input % 2, weight.into());
        }
    }
}

/// Runs [`Direct::convolve_max_pool`] with the octets that the processor supports.
#[cfg(not(smlad))]
impl<const PAIRS: usize, const COLUMNS: usize> Kernel
    for (&Direct<'_, PAIRS, COLUMNS>, [&[Pair]; 3], &mut [i32])
{
    #[inline(always)]
    fn run<O: Octet>(self) {
        let (conv, transformed, largest) = self;
        conv.convolve_max_pool_with::<O>(transformed, largest);
    }
}
