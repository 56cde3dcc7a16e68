//! One tile of Winograd's convolution: its dimensions and its transforms.

use core::ops::{Add, Sub};

use crate::{
    dot::{OUTPUTS, POSITIONS},
    pair::Pair,
};

/// Numbers of rows and columns of outputs in a tile.
pub(super) const TILE: [usize; 2] = [2, 4];
/// Numbers of rows and columns in a transformed tile: each is two more than in a tile of outputs.
pub(super) const TRANSFORMED_TILE: [usize; 2] = [4, 6];
/// Number of products per tile, pair of channels and time step: 24. A direct convolution needs 72,
/// nine for each of the eight outputs.
pub(super) const PRODUCTS: usize = TRANSFORMED_TILE[0] * TRANSFORMED_TILE[1];
/// Factor by which the transforms enlarge a sum: 2 from the rows, times 24 from the columns.
pub(super) const SCALE: usize = 48;
/// Number of pool windows in a tile; they are side by side.
pub(super) const WINDOWS: usize = 2;

/// Sums of one of the tile's products over the input channels and the three time steps, in the
/// order `[position][output]`.
pub(super) type Sums = [i32; POSITIONS * OUTPUTS];

/// Several numbers to which each operation of a transform applies at once.
pub(super) trait Lanes: Copy + Add<Output = Self> + Sub<Output = Self> {
    /// Multiplies all numbers by four; all must be in 0..2^13.
    fn quadrupled(self) -> Self;
}

impl Lanes for Pair {
    #[inline(always)]
    fn quadrupled(self) -> Self {
        Self::quadrupled(self)
    }
}

#[inline(always)]
fn transform_columns<L: Lanes>([d0, d1, d2, d3, d4, d5]: [L; 6]) -> [L; 6] {
    let (p, q) = (d4 - d2.quadrupled(), d3 - d1.quadrupled());
    let (r, s) = (d4 - d2, d3 - d1);
    let twice = s + s;
    [d0.quadrupled() - d2 + p, p + q, p - q, r + twice, r - twice, d5 - d3.quadrupled() - q]
}

#[inline(always)]
fn transform_rows<L: Lanes>([d0, d1, d2, d3]: [L; 4]) -> [L; 4] {
    [d0 - d2, d1 + d2, d2 - d1, d1 - d3]
}

/// Transforms the inputs of a tile, `[row][column]`, to the factors of its products.
#[cfg(not(smlad))]
#[inline(always)]
pub(super) fn transform_tile<L: Lanes>(tile: [[L; 6]; 4]) -> [[L; 6]; 4] {
    let [a, b, c, d] = tile;
    let rows =
        [transform_columns(a), transform_columns(b), transform_columns(c), transform_columns(d)];
    let mut out = rows;
    for x in 0..TRANSFORMED_TILE[1] {
        let column = transform_rows([rows[0][x], rows[1][x], rows[2][x], rows[3][x]]);
        for (out, value) in out.iter_mut().zip(column) {
            out[x] = value;
        }
    }
    out
}

/// Transforms the inputs of a tile for a pair of channels. A row of `tile` starts `COLUMNS` pairs
/// after the previous row; a product in `out` is `POSITIONS * PAIRS` pairs after the previous one.
#[cfg(smlad)]
#[inline(always)]
pub(super) fn transform_inputs<const PAIRS: usize, const COLUMNS: usize>(
    tile: &[Pair],
    out: &mut [Pair],
) {
    let rows: [[Pair; TRANSFORMED_TILE[1]]; TRANSFORMED_TILE[0]] = core::array::from_fn(|y| {
        transform_columns(core::array::from_fn(|x| tile[y * COLUMNS + x]))
    });
    let last = (PRODUCTS - 1) * POSITIONS * PAIRS;
    let out = &mut out[..=last];
    for x in 0..TRANSFORMED_TILE[1] {
        let column = transform_rows(rows.map(|row| row[x]));
        for (y, value) in column.into_iter().enumerate() {
            out[(y * TRANSFORMED_TILE[1] + x) * POSITIONS * PAIRS] = value;
        }
    }
}

/// Transforms the weights `tap(row, column)` of one input and output channel and one time step.
pub(super) fn transform_taps(tap: impl Fn(usize, usize) -> i32) -> [i16; PRODUCTS] {
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
        let [g0, g1, g2] = columns.map(|row| row[product % TRANSFORMED_TILE[1]]);
        let value = [2 * g0, g0 + g1 + g2, g0 - g1 + g2, 2 * g2][product / TRANSFORMED_TILE[1]];
        i16::try_from(value).expect("72 times a weight of 8 bits")
    })
}

/// Computes the outputs of `tiles` tiles for a pair of output channels from `sums`, and keeps the
/// maximum of each pool window in `windows[(tile * WINDOWS + window) * outputs + output]`.
///
/// This is the portable equivalent of the assembler. It transforms the rows first: 44 additions per
/// tile and output, instead of 56 with the columns first.
#[cfg(not(smlad))]
#[inline(always)]
pub(super) fn keep_largest(
    sums: &[Sums; PRODUCTS],
    tiles: usize,
    outputs: usize,
    windows: &mut [i32],
) {
    for tile in 0..tiles {
        for output in 0..OUTPUTS {
            let sum =
                |y: usize, x: usize| sums[y * TRANSFORMED_TILE[1] + x][tile * OUTPUTS + output];
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

/// Returns the four outputs of a row of a tile from the six sums of that row.
#[cfg(not(smlad))]
#[inline(always)]
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
