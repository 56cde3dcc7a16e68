//! An exact integer Winograd convolution, one plane at a time.

#[cfg(smlad)]
mod cortex_m;

use crate::{
    Pair, PlaneShape,
    dot::{self, OUTPUTS, POSITIONS, dots},
};

/// Rows and columns of outputs that one tile gives.
const TILE: [usize; 2] = [2, 4];
/// Rows and columns of products in a tile.
const FREQUENCIES: [usize; 2] = [4, 6];
/// Products of a tile for each pair of channels and time step, where a direct convolution needs nine
/// for each of eight outputs.
const PRODUCTS: usize = FREQUENCIES[0] * FREQUENCIES[1];
/// What a sum is multiplied by: 2 in the rows, 24 in the columns.
const SCALE: usize = 48;
/// Weights of an input and an output channel: (time, row, column).
const TAPS: usize = 27;
/// Pool windows of a tile.
const WINDOWS: usize = 2;

/// Most output channels: three tiles of them fit any word.
const MOST_OUTPUTS: usize = 65_536;

/// Sums of one product: `[position][output]`.
type Sums = [i32; POSITIONS * OUTPUTS];

/// A 3x3x3 convolution over (time, row, column), stride 1, unpadded, followed by a 2x2x2 max-pool.
///
/// A plane is computed in tiles of 2x4 outputs with Winograd's F(2x4, 3x3), and directly in time:
/// 72 products instead of 216 per tile and pair of channels. All numbers are integers, and the
/// result is that of the direct convolution, bit for bit: transformed weights are 48 times the usual
/// fractions, and 48 times the sum is divided exactly.
///
/// In the columns, with inputs d and weights g (points 0, 1, -1, 2, -2 and infinity of Lavin and
/// Gray, arXiv 1509.09308): `V = (4 d0 - 5 d2 + d4, p + q, p - q, r + 2 s, r - 2 s, 4 d1 - 5 d3 + d5)`
/// with `p = d4 - 4 d2, q = d3 - 4 d1, r = d4 - d2, s = d3 - d1`, and `U = (6 g0, -4 (g0 + g1 + g2),
/// -4 (g0 - g1 + g2), g0 + 2 g1 + 4 g2, g0 - 2 g1 + 4 g2, 24 g2)`. In the rows `V = (d0 - d2, d1 + d2,
/// d2 - d1, d1 - d3)` and `U = (2 g0, g0 + g1 + g2, g0 - g1 + g2, 2 g2)`.
///
/// Ranges: weights -127..=127 give |U| <= 9144, within `i16`, inputs from 0 |V| up to 16 times as
/// large; both, and 48 times a sum, set [`Winograd::LARGEST_INPUT`], 815 for 16 channels.
///
/// `PAIRS` are the pairs of input channels, `COLUMNS` the columns of the input: two more than a
/// multiple of four.
#[derive(Clone, Copy, Debug)]
pub struct Winograd<'w, const PAIRS: usize, const COLUMNS: usize> {
    /// Tiles below each other: the plane has two rows for each.
    pub tile_rows: usize,
    /// Channels of the output, an even number.
    pub outputs: usize,
    /// What [`Self::transform_weights`] makes, [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
}

impl<const PAIRS: usize, const COLUMNS: usize> Winograd<'_, PAIRS, COLUMNS> {
    /// Largest input: 48 times a sum of 27 products with weights of up to 127 for each channel stays
    /// below 2^31, and transformed inputs, up to 16 times an input, below 2^15.
    pub const LARGEST_INPUT: usize = {
        let by_sum = ((1 << 31) - 1) / (SCALE * TAPS * 2 * PAIRS * 127);
        let by_input = ((1 << 15) - 1) / 16;
        if by_sum < by_input { by_sum } else { by_input }
    };

    /// Tiles beside each other.
    const TILE_COLUMNS: usize = (COLUMNS - 2) / TILE[1];

    /// Shape of an input plane.
    pub const fn input(&self) -> PlaneShape {
        PlaneShape {
            rows: TILE[0] * self.tile_rows + 2,
            columns: COLUMNS,
            channels: 2 * PAIRS,
        }
    }

    /// Shape of a pooled plane, which two planes of outputs make.
    pub const fn pooled(&self) -> PlaneShape {
        PlaneShape {
            rows: self.tile_rows,
            columns: WINDOWS * Self::TILE_COLUMNS,
            channels: self.outputs,
        }
    }

    /// Pairs in a transformed plane: `[group of tiles][product][tile][pair of channels]`.
    pub const fn transformed_len(&self) -> usize {
        self.groups() * Self::GROUP
    }

    /// Pairs in the transformed weights of so many outputs: `[pair of outputs][product]`, then as the
    /// products want them.
    pub const fn weights_len(outputs: usize) -> usize {
        outputs * 3 * PRODUCTS * PAIRS
    }

    /// True when this convolution fits between planes of these shapes and its weights have the
    /// length that this asks for; assert it in `const`.
    pub const fn is_consistent(&self, input: PlaneShape, pooled: PlaneShape) -> bool {
        const { assert!(Self::LARGEST_INPUT >= 255, "an activation of 8 bits") };
        const { assert!(COLUMNS > 2 && (COLUMNS - 2).is_multiple_of(TILE[1])) };
        self.input().equals(input)
            && self.pooled().equals(pooled)
            && self.tile_rows > 0
            && self.outputs > 0
            && self.outputs.is_multiple_of(OUTPUTS)
            && self.outputs <= MOST_OUTPUTS
            && self.weights.len() == Self::weights_len(self.outputs)
    }

    /// Pairs that a group of tiles takes in a transformed plane.
    const GROUP: usize = PRODUCTS * POSITIONS * PAIRS;

    /// Groups of as many tiles as are multiplied together; the last one may have tiles that are
    /// left alone.
    const fn groups(&self) -> usize {
        (self.tile_rows * Self::TILE_COLUMNS).div_ceil(POSITIONS)
    }

    /// Transforms an input plane of shape [`Self::input`], values 0..=[`Self::LARGEST_INPUT`], `[pair of
    /// channels][row][column]`.
    ///
    /// # Panics
    /// When a slice is shorter than its shape says.
    pub fn transform(&self, plane: &[Pair], transformed: &mut [Pair]) {
        let positions = self.input().rows * COLUMNS;
        let planes = plane[..PAIRS * positions].chunks_exact(positions);
        for (pair, plane) in planes.enumerate() {
            for tile in 0..self.tile_rows * Self::TILE_COLUMNS {
                let row = tile / Self::TILE_COLUMNS * TILE[0];
                let column = tile % Self::TILE_COLUMNS * TILE[1];
                let first = tile / POSITIONS * Self::GROUP + tile % POSITIONS * PAIRS + pair;
                let corner = row * COLUMNS + column;
                let window = &plane[corner..corner + 3 * COLUMNS + FREQUENCIES[1]];
                transform_tile::<PAIRS, COLUMNS>(window, &mut transformed[first..]);
            }
        }
    }

    /// The plane of outputs that ends with the last of three transformed planes, oldest first: where
    /// the largest output of a pool window exceeds what `largest`, of shape [`Self::pooled`], holds,
    /// it takes its place. Without bias, and 48 times too large: [`Self::unscaled`] divides.
    ///
    /// # Panics
    /// When a slice is shorter than its shape says, or there are not as many weights as outputs ask
    /// for: [`Self::is_consistent`].
    pub fn pool(&self, transformed: [&[Pair]; 3], largest: &mut [i32]) {
        assert!(
            self.is_consistent(self.input(), self.pooled()),
            "whole pairs of outputs and as many weights"
        );
        let largest = &mut largest[..self.pooled().len()];
        let weights_of_pair = dot::weights_len(3 * PAIRS) * PRODUCTS;
        let tiles = self.tile_rows * Self::TILE_COLUMNS;
        let mut sums = [[0; POSITIONS * OUTPUTS]; PRODUCTS];
        for group in 0..self.groups() {
            let first = group * Self::GROUP;
            let inputs = transformed.map(|plane| &plane[first..first + Self::GROUP]);
            let first = group * POSITIONS;
            let tiles = POSITIONS.min(tiles - first);
            for (pair, weights) in self.weights.chunks_exact(weights_of_pair).enumerate() {
                dots::<3, PAIRS, PAIRS>(inputs, weights, &mut sums);
                let windows = &mut largest[first * WINDOWS * self.outputs + pair * OUTPUTS..];
                keep_largest(&sums, tiles, self.outputs, windows);
            }
        }
    }

    /// A sum of [`Self::pool`] as the direct convolution has it: divided by 48, exactly.
    #[inline]
    pub const fn unscaled(sum: i32) -> i32 {
        // 48 = 3 * 2^4, and 3 * 0xAAAA_AAAB = 1 modulo 2^32.
        (sum >> 4).wrapping_mul(0xAAAA_AAAB_u32.cast_signed())
    }

    /// Transforms weights `[time][row][column][input][output]` to what [`Self::weights`] holds.
    ///
    /// # Panics
    /// When the slices do not have 54 * `PAIRS` * `outputs` and [`Self::weights_len`] numbers, or a
    /// weight is -128.
    pub fn transform_weights(outputs: usize, weights: &[i8], transformed: &mut [Pair]) {
        let channels = 2 * PAIRS;
        assert_eq!(weights.len(), TAPS * channels * outputs, "27 taps each");
        assert!(!weights.contains(&i8::MIN), "weights are symmetric");
        let per_product = dot::weights_len(3 * PAIRS);
        for output in 0..outputs {
            for time in 0..3 {
                for channel in 0..channels {
                    let tap = |row: usize, column: usize| {
                        let tap = (time * 3 + row) * 3 + column;
                        weights[(tap * channels + channel) * outputs + output].into()
                    };
                    let at = dot::weight_at(output % OUTPUTS, time * PAIRS + channel / 2);
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

#[inline(always)]
fn transform_columns([d0, d1, d2, d3, d4, d5]: [Pair; 6]) -> [Pair; 6] {
    let (p, q) = (d4 - d2.quadrupled(), d3 - d1.quadrupled());
    let (r, s) = (d4 - d2, d3 - d1);
    let twice = s + s;
    [
        d0.quadrupled() - d2 + p,
        p + q,
        p - q,
        r + twice,
        r - twice,
        d5 - d3.quadrupled() - q,
    ]
}

#[inline(always)]
fn transform_rows([d0, d1, d2, d3]: [Pair; 4]) -> [Pair; 4] {
    [d0 - d2, d1 + d2, d2 - d1, d1 - d3]
}

/// Transforms a tile of a pair of channels, whose rows lie `COLUMNS` apart:
/// `out[product * POSITIONS * PAIRS]`.
#[inline(always)]
fn transform_tile<const PAIRS: usize, const COLUMNS: usize>(tile: &[Pair], out: &mut [Pair]) {
    let rows: [[Pair; FREQUENCIES[1]]; FREQUENCIES[0]] = core::array::from_fn(|y| {
        transform_columns(core::array::from_fn(|x| tile[y * COLUMNS + x]))
    });
    let last = (PRODUCTS - 1) * POSITIONS * PAIRS;
    let out = &mut out[..=last];
    for x in 0..FREQUENCIES[1] {
        let column = transform_rows(rows.map(|row| row[x]));
        for (y, value) in column.into_iter().enumerate() {
            out[(y * FREQUENCIES[1] + x) * POSITIONS * PAIRS] = value;
        }
    }
}

/// Transforms the sums of `tiles` tiles and a pair of outputs back and keeps the largest of each
/// pool window: `windows[(tile * WINDOWS + window) * outputs + output]`.
#[inline(always)]
fn keep_largest(sums: &[Sums; PRODUCTS], tiles: usize, outputs: usize, windows: &mut [i32]) {
    let windows = &mut windows[..(WINDOWS * tiles - 1) * outputs + OUTPUTS];
    #[cfg(smlad)]
    cortex_m::keep_largest(sums, tiles, outputs, windows);
    #[cfg(not(smlad))]
    keep_largest_portable(sums, tiles, outputs, windows);
}

/// The twin of the assembler, in plain Rust. Rows first: 44 additions instead of 56.
#[cfg(not(smlad))]
fn keep_largest_portable(
    sums: &[Sums; PRODUCTS],
    tiles: usize,
    outputs: usize,
    windows: &mut [i32],
) {
    for tile in 0..tiles {
        for output in 0..OUTPUTS {
            let sum = |y: usize, x: usize| sums[y * FREQUENCIES[1] + x][tile * OUTPUTS + output];
            let upper = row_outputs(core::array::from_fn(|x| {
                sum(0, x).wrapping_add(sum(1, x)).wrapping_add(sum(2, x))
            }));
            let lower = row_outputs(core::array::from_fn(|x| {
                sum(1, x).wrapping_sub(sum(2, x)).wrapping_sub(sum(3, x))
            }));
            for window in 0..WINDOWS {
                let place = &mut windows[(tile * WINDOWS + window) * outputs + output];
                for row in [upper, lower] {
                    *place = row[2 * window].max(row[2 * window + 1]).max(*place);
                }
            }
        }
    }
}

/// Four outputs of a row from its six sums.
#[cfg(not(smlad))]
fn row_outputs([m0, m1, m2, m3, m4, m5]: [i32; 6]) -> [i32; TILE[1]] {
    let (a, b) = (m1.wrapping_add(m2), m1.wrapping_sub(m2));
    let (c, d) = (m3.wrapping_add(m4), m3.wrapping_sub(m4));
    [
        m0.wrapping_add(a).wrapping_add(c),
        b.wrapping_add(d << 1),
        a.wrapping_add(c << 2),
        b.wrapping_add(d << 3).wrapping_add(m5),
    ]
}

/// The transformed weights of one input and output channel, from a tap at (row, column).
fn transform_taps(tap: impl Fn(usize, usize) -> i32) -> [i16; PRODUCTS] {
    let columns: [[i32; 6]; 3] = core::array::from_fn(|row| {
        let [g0, g1, g2] = core::array::from_fn(|column| tap(row, column));
        [
            6 * g0,
            -4 * (g0 + g1 + g2),
            -4 * (g0 - g1 + g2),
            g0 + 2 * g1 + 4 * g2,
            g0 - 2 * g1 + 4 * g2,
            24 * g2,
        ]
    });
    core::array::from_fn(|product| {
        let [g0, g1, g2] = columns.map(|row| row[product % FREQUENCIES[1]]);
        let value = [2 * g0, g0 + g1 + g2, g0 - g1 + g2, 2 * g2][product / FREQUENCIES[1]];
        i16::try_from(value).expect("72 times a weight of 8 bits")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividing_by_48_is_exact() {
        for sum in [0, 1, -1, 12_345, -44_739_242, 44_739_242] {
            assert_eq!(Winograd::<8, 6>::unscaled(48 * sum), sum);
        }
    }
}
