//! An exact integer Winograd convolution, one plane at a time.

#[cfg(not(smlad))]
mod channels;
#[cfg(smlad)]
mod cortex_m;
mod tile;

#[cfg(not(smlad))]
use crate::octet::Kernel;
use crate::{
    dot::{self, OUTPUTS, POSITIONS, dots},
    octet::{self, Octet},
    pair::Pair,
    plane::PlaneShape,
};
#[cfg(smlad)]
use cortex_m::keep_largest;
#[cfg(not(smlad))]
use tile::keep_largest;
#[cfg(smlad)]
use tile::transform_inputs;
use tile::{PRODUCTS, SCALE, TILE, TRANSFORMED_TILE, WINDOWS, transform_taps};
#[cfg(not(smlad))]
use {channels::Channels, tile::transform_tile};

/// Number of weights for each pair of input and output channel: 3 steps x 3 rows x 3 columns.
const TAPS: usize = 27;
/// Largest number of output channels. With more, byte offsets of three tiles could exceed 32 bits.
const MAX_OUTPUTS: usize = 65_536;

/// A 3x3x3 convolution over (time, row, column), stride 1, unpadded, followed by a 2x2x2 max-pool.
///
/// A plane is computed in tiles of 2x4 outputs with Winograd's F(2x4, 3x3), and directly in time:
/// 72 products instead of 216 per tile and pair of channels. All numbers are integers, and the
/// result equals the direct convolution bit for bit: the transformed weights are 48 times the usual
/// fractions, and the sum, 48 times too large, is divided by 48 without remainder.
///
/// In the columns, inputs d become V and weights g become U, with the points 0, 1, -1, 2, -2 and
/// infinity of Lavin and Gray (arXiv 1509.09308):
/// `V = (4 d0 - 5 d2 + d4, p + q, p - q, r + 2 s, r - 2 s, 4 d1 - 5 d3 + d5)` with
/// `p = d4 - 4 d2, q = d3 - 4 d1, r = d4 - d2, s = d3 - d1`, and
/// `U = (6 g0, -4 (g0 + g1 + g2), -4 (g0 - g1 + g2), g0 + 2 g1 + 4 g2, g0 - 2 g1 + 4 g2, 24 g2)`.
/// In the rows `V = (d0 - d2, d1 + d2, d2 - d1, d1 - d3)` and
/// `U = (2 g0, g0 + g1 + g2, g0 - g1 + g2, 2 g2)`.
///
/// Ranges: with weights -127..=127, |U| <= 9144, which fits `i16`. With inputs 0..=x, |V| <= 16 x
/// must fit 16 bits, and 48 times a sum 32 bits: the two limits determine
/// [`Winograd::LARGEST_INPUT`], 815 for 16 channels.
///
/// `PAIRS` is the number of pairs of input channels; `COLUMNS` is the number of columns of the
/// input, a multiple of four plus two.
#[derive(Clone, Copy, Debug)]
pub struct Winograd<'w, const PAIRS: usize, const COLUMNS: usize> {
    /// Number of rows of tiles; each tile has two rows of outputs.
    pub tile_rows: usize,
    /// Number of output channels, which must be even.
    pub outputs: usize,
    /// Weights, transformed by [`Self::transform_weights`]: [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
}

impl<const PAIRS: usize, const COLUMNS: usize> Winograd<'_, PAIRS, COLUMNS> {
    /// Largest permitted input. With weights up to 127, it keeps 48 times a sum of 27 products per
    /// channel below 2^31, and transformed inputs (up to 16 times an input) below 2^15.
    pub const LARGEST_INPUT: usize = {
        let by_sum = ((1 << 31) - 1) / (SCALE * TAPS * 2 * PAIRS * 127);
        let by_input = ((1 << 15) - 1) / 16;
        if by_sum < by_input { by_sum } else { by_input }
    };

    /// Number of columns of tiles; each tile has four columns of outputs.
    const TILE_COLUMNS: usize = (COLUMNS - 2) / TILE[1];

    /// Returns the shape of an input plane: the shape of the outputs of all tiles, plus the two
    /// rows and two columns by which an unpadded convolution shrinks a plane.
    pub const fn input(&self) -> PlaneShape {
        PlaneShape { rows: TILE[0] * self.tile_rows + 2, columns: COLUMNS, channels: 2 * PAIRS }
    }

    /// Returns the shape of a pooled plane, which holds the maxima over two planes of outputs.
    pub const fn pooled(&self) -> PlaneShape {
        PlaneShape {
            rows: self.tile_rows,
            columns: WINDOWS * Self::TILE_COLUMNS,
            channels: self.outputs,
        }
    }

    /// Returns the number of pairs in a transformed plane, whose order is
    /// `[group of tiles][product][tile][pair of channels]`.
    pub const fn transformed_len(&self) -> usize {
        self.groups() * Self::GROUP
    }

    /// Returns the number of pairs in the transformed weights of `outputs` output channels. Their
    /// order is `[pair of outputs][product]`; `weight_index` in `dot` defines the order within a
    /// product.
    pub const fn weights_len(outputs: usize) -> usize {
        outputs * 3 * PRODUCTS * PAIRS
    }

    /// Returns true if this convolution turns planes of shape `input` into planes of shape `pooled`
    /// and has the right number of weights. Callers should assert it in a `const` context.
    pub const fn is_consistent(&self, input: PlaneShape, pooled: PlaneShape) -> bool {
        const { assert!(Self::LARGEST_INPUT >= 255, "8-bit inputs must be allowed") };
        const { assert!(COLUMNS > 2 && (COLUMNS - 2).is_multiple_of(TILE[1])) };
        self.input().equals(input)
            && self.pooled().equals(pooled)
            && self.tile_rows > 0
            && self.outputs > 0
            && self.outputs.is_multiple_of(OUTPUTS)
            && self.outputs <= MAX_OUTPUTS
            && self.weights.len() == Self::weights_len(self.outputs)
    }

    /// Number of pairs that a group of tiles has in a transformed plane.
    const GROUP: usize = PRODUCTS * POSITIONS * PAIRS;

    /// Returns the number of groups of [`POSITIONS`] tiles that are multiplied together. The last
    /// group may have fewer tiles.
    const fn groups(&self) -> usize {
        (self.tile_rows * Self::TILE_COLUMNS).div_ceil(POSITIONS)
    }

    /// Transforms an input plane of shape [`Self::input`], whose values are
    /// 0..=[`Self::LARGEST_INPUT`] in the order `[pair of channels][row][column]`.
    ///
    /// # Panics
    /// If a slice is shorter than its shape requires.
    pub fn transform(&self, plane: &[Pair], transformed: &mut [Pair]) {
        let positions = self.input().rows * COLUMNS;
        let plane = &plane[..PAIRS * positions];
        #[cfg(not(smlad))]
        octet::run((self, plane, transformed));
        #[cfg(smlad)]
        for (pair, plane) in plane.chunks_exact(positions).enumerate() {
            for tile in 0..self.tile_rows * Self::TILE_COLUMNS {
                let row = tile / Self::TILE_COLUMNS * TILE[0];
                let column = tile % Self::TILE_COLUMNS * TILE[1];
                let first = tile / POSITIONS * Self::GROUP + tile % POSITIONS * PAIRS + pair;
                let corner = row * COLUMNS + column;
                let window = &plane[corner..corner + 3 * COLUMNS + TRANSFORMED_TILE[1]];
                transform_inputs::<PAIRS, COLUMNS>(window, &mut transformed[first..]);
            }
        }
    }

    /// Convolves three planes, transformed by [`Self::transform`], oldest first, into one plane of
    /// outputs, and max-pools the outputs into `largest`, of shape [`Self::pooled`].
    ///
    /// `largest[i]` becomes the maximum of its previous value and the outputs of pool window `i`,
    /// so that two calls also pool over time. No bias is added, and all sums are 48 times too
    /// large; [`Self::unscaled`] divides by 48.
    ///
    /// # Panics
    /// If a slice is shorter than its shape requires, or [`Self::is_consistent`] is false.
    pub fn convolve_max_pool(&self, transformed: [&[Pair]; 3], largest: &mut [i32]) {
        assert!(
            self.is_consistent(self.input(), self.pooled()),
            "the shapes and the number of weights are inconsistent"
        );
        let largest = &mut largest[..self.pooled().len()];
        #[cfg(smlad)]
        self.convolve_max_pool_with::<octet::Plain>(transformed, largest);
        #[cfg(not(smlad))]
        octet::run((self, transformed, largest));
    }

    /// Does what [`Self::convolve_max_pool`] does, with octets of type `O`.
    #[inline(always)]
    fn convolve_max_pool_with<O: Octet>(&self, transformed: [&[Pair]; 3], largest: &mut [i32]) {
        let weights_of_pair = dot::weights_len(3 * PAIRS) * PRODUCTS;
        let tiles = self.tile_rows * Self::TILE_COLUMNS;
        let mut sums = [[0; POSITIONS * OUTPUTS]; PRODUCTS];
        for group in 0..self.groups() {
            let first = group * Self::GROUP;
            let inputs = transformed.map(|plane| &plane[first..first + Self::GROUP]);
            let first = group * POSITIONS;
            let tiles = POSITIONS.min(tiles - first);
            for (pair, weights) in self.weights.chunks_exact(weights_of_pair).enumerate() {
                dots::<O, 3, PAIRS, PAIRS>(inputs, weights, &mut sums);
                let windows = &mut largest[first * WINDOWS * self.outputs + pair * OUTPUTS..];
                let windows = &mut windows[..(WINDOWS * tiles - 1) * self.outputs + OUTPUTS];
                keep_largest(&sums, tiles, self.outputs, windows);
            }
        }
    }

    /// Returns a sum of [`Self::convolve_max_pool`] divided by 48; the remainder is always 0.
    #[inline]
    pub const fn unscaled(sum: i32) -> i32 {
        // The multiplication divides by 3: 48 = 3 * 2^4, and 3 * 0xAAAA_AAAB = 1 modulo 2^32.
        (sum >> 4).wrapping_mul(0xAAAA_AAAB_u32.cast_signed())
    }

    /// Transforms weights `[time][row][column][input][output]` for the field `weights`.
    ///
    /// # Panics
    /// If `weights` does not have 54 * `PAIRS` * `outputs` numbers, `transformed` is shorter than
    /// [`Self::weights_len`], or a weight is -128.
    pub fn transform_weights(outputs: usize, weights: &[i8], transformed: &mut [Pair]) {
        let channels = 2 * PAIRS;
        assert_eq!(
            weights.len(),
            TAPS * channels * outputs,
            "27 weights for each input and output"
        );
        assert!(!weights.contains(&i8::MIN), "weights are -127..=127");
        let per_product = dot::weights_len(3 * PAIRS);
        for output in 0..outputs {
            for time in 0..3 {
                for channel in 0..channels {
                    let tap = |row: usize, column: usize| {
                        let tap = (time * 3 + row) * 3 + column;
                        weights[(tap * channels + channel) * outputs + output].into()
                    };
                    let at = dot::weight_index(output % OUTPUTS, time * PAIRS + channel / 2);
                    for (product, value) in transform_taps(tap).into_iter().enumerate() {
                        let step = output / OUTPUTS * PRODUCTS + product;
                        let pair = &mut transformed[step * per_product + at];
                        *pair = pair.with(channel % 2, value);
                    }
                }
            }
        }
    }
}

/// Runs [`Winograd::transform`] with the octets that the processor supports.
#[cfg(not(smlad))]
impl<const PAIRS: usize, const COLUMNS: usize> Kernel
    for (&Winograd<'_, PAIRS, COLUMNS>, &[Pair], &mut [Pair])
{
    #[inline(always)]
    fn run<O: Octet>(self) {
        let (conv, plane, transformed) = self;
        let positions = plane.len() / PAIRS;
        let tile_columns = Winograd::<PAIRS, COLUMNS>::TILE_COLUMNS;
        for tile in 0..conv.tile_rows * tile_columns {
            let row = tile / tile_columns * TILE[0];
            let column = tile % tile_columns * TILE[1];
            let corner = row * COLUMNS + column;
            let mut window = [[Channels::<PAIRS>::ZERO; TRANSFORMED_TILE[1]]; TRANSFORMED_TILE[0]];
            for (y, window) in window.iter_mut().enumerate() {
                for (x, channels) in window.iter_mut().enumerate() {
                    *channels = Channels::gather(&plane[corner + y * COLUMNS + x..], positions);
                }
            }
            let group = Winograd::<PAIRS, COLUMNS>::GROUP;
            let first = tile / POSITIONS * group + tile % POSITIONS * PAIRS;
            let reach = group - (POSITIONS - 1) * PAIRS;
            let products = transformed[first..first + reach].chunks_mut(POSITIONS * PAIRS);
            let window = transform_tile(window);
            for (channels, product) in window.as_flattened().iter().zip(products) {
                channels.store(product);
            }
        }
    }
}

/// Runs [`Winograd::convolve_max_pool`] with the octets that the processor supports.
#[cfg(not(smlad))]
impl<const PAIRS: usize, const COLUMNS: usize> Kernel
    for (&Winograd<'_, PAIRS, COLUMNS>, [&[Pair]; 3], &mut [i32])
{
    #[inline(always)]
    fn run<O: Octet>(self) {
        let (conv, transformed, largest) = self;
        conv.convolve_max_pool_with::<O>(transformed, largest);
    }
}
