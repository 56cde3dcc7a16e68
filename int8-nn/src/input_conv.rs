//! The first convolution of a network: a single input channel.

use crate::{
    Pair, PlaneShape,
    dot::{self, OUTPUTS, POSITIONS, dots},
    requantise, saturate_u8,
};

/// Weights of an output channel: (time, row, column).
const TAPS: usize = 27;
/// The same with a zero, in pairs.
const WIDTH: usize = 14;
/// Pairs that the inputs of a group of positions take.
const GROUP: usize = POSITIONS * WIDTH;

/// A 3x3x3 convolution of one channel over (time, row, column), stride 1, unpadded, with ReLU, one
/// plane per call.
///
/// Each position's 27 inputs are laid side by side first; the products then run through them as
/// those of any other layer do.
#[derive(Clone, Copy, Debug)]
pub struct InputConv<'w> {
    /// Shape of an input plane; one channel.
    pub input: PlaneShape,
    /// Shape of an output plane: up to two rows and two columns less. More of each are left out,
    /// where nobody reads them.
    pub output: PlaneShape,
    /// What [`Self::pack_weights`] makes, [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
    /// One per output channel, in accumulator steps.
    pub bias: &'w [i32],
    /// Requantisation factors, one per output channel, Q0.32.
    pub multipliers: &'w [i32],
}

impl InputConv<'_> {
    /// Pairs in the packed weights.
    pub const fn weights_len(&self) -> usize {
        self.output.channels * WIDTH
    }

    /// Pairs that [`Self::plane`] needs for the inputs of all positions.
    pub const fn patches_len(&self) -> usize {
        self.groups() * GROUP
    }

    /// Numbers that [`Self::plane`] needs for the sums of a pair of outputs.
    pub const fn sums_len(&self) -> usize {
        self.groups() * POSITIONS * OUTPUTS
    }

    /// True when weights, bias and factors have the lengths that the shapes ask for; assert it in
    /// `const`.
    pub const fn is_consistent(&self, input: PlaneShape, output: PlaneShape) -> bool {
        self.input.equals(input)
            && self.output.equals(output)
            && input.channels == 1
            && output.rows + 2 <= input.rows
            && output.columns + 2 <= input.columns
            && output.channels.is_multiple_of(OUTPUTS)
            && self.weights.len() == self.weights_len()
            && self.bias.len() == output.channels
            && self.multipliers.len() == output.channels
    }

    /// Groups of as many positions as are multiplied together.
    const fn groups(&self) -> usize {
        (self.output.rows * self.output.columns).div_ceil(POSITIONS)
    }

    /// Writes the output plane, values 0..=255, `[pair of channels][row][column]`, that ends with the
    /// last of three input planes as [`Self::pair_up`] makes them, oldest first. `patches` and `sums` are scratch.
    ///
    /// # Panics
    /// When a slice is shorter than its shape says.
    pub fn plane(
        &self,
        planes: [&[Pair]; 3],
        patches: &mut [Pair],
        sums: &mut [i32],
        output: &mut [Pair],
    ) {
        let patches = &mut patches[..self.patches_len()];
        let sums = &mut sums[..self.sums_len()];
        self.lay_out(planes, patches);
        let positions = self.output.rows * self.output.columns;
        let channels = self
            .bias
            .as_chunks::<OUTPUTS>()
            .0
            .iter()
            .zip(self.multipliers.as_chunks::<OUTPUTS>().0);
        let weights = self.weights.chunks_exact(OUTPUTS * WIDTH);
        for ((places, weights), (bias, multipliers)) in output
            .chunks_exact_mut(positions)
            .zip(weights)
            .zip(channels)
        {
            dots::<1, WIDTH>([patches], weights, sums.as_chunks_mut().0);
            for (place, sums) in places.iter_mut().zip(sums.as_chunks::<OUTPUTS>().0) {
                let activation = |index: usize| {
                    let sum = sums[index].wrapping_add(bias[index]);
                    i16::from(saturate_u8(requantise(sum, multipliers[index])))
                };
                *place = Pair::new([activation(0), activation(1)]);
            }
        }
    }

    /// Pairs every input of a plane with its right neighbour, the last one of the plane with 0.
    ///
    /// # Panics
    /// When a slice is shorter than the input plane.
    pub fn pair_up(&self, plane: &[i8], pairs: &mut [Pair]) {
        let plane = &plane[..self.input.len()];
        for (pair, neighbours) in pairs.iter_mut().zip(plane.windows(2)) {
            *pair = Pair::new([neighbours[0].into(), neighbours[1].into()]);
        }
        if let (Some(pair), Some(&last)) = (pairs.get_mut(plane.len() - 1), plane.last()) {
            *pair = Pair::new([last.into(), 0]);
        }
    }

    /// Lays the inputs of each position side by side: of each (time, row) the first two columns, then
    /// the third ones, two rows in a pair, and a zero.
    fn lay_out(&self, planes: [&[Pair]; 3], patches: &mut [Pair]) {
        let columns = self.output.columns;
        let rows = patches.chunks_mut(columns * WIDTH).take(self.output.rows);
        for (row, patches) in rows.enumerate() {
            let rows: [&[Pair]; 9] = core::array::from_fn(|index| {
                let first = self.input.at(row + index % 3, 0);
                &planes[index / 3][first..first + columns + 2]
            });
            for (column, patch) in patches.as_chunks_mut::<WIDTH>().0.iter_mut().enumerate() {
                let third = |row: usize| rows[row][column + 2];
                let (firsts, thirds) = patch.split_at_mut(rows.len());
                for (place, row) in firsts.iter_mut().zip(rows) {
                    *place = row[column];
                }
                thirds.copy_from_slice(&[
                    third(0).first_of(third(1)),
                    third(2).first_of(third(3)),
                    third(4).first_of(third(5)),
                    third(6).first_of(third(7)),
                    third(8).first_of(Pair::ZERO),
                ]);
            }
        }
    }

    /// Orders weights `[time][row][column][output]` as [`Self::weights`] holds them.
    ///
    /// # Panics
    /// When there are not 27 weights and 14 pairs for each of an even number of outputs.
    pub fn pack_weights(outputs: usize, weights: &[i8], packed: &mut [Pair]) {
        assert_eq!(weights.len(), TAPS * outputs, "27 taps each");
        packed.fill(Pair::ZERO);
        for (at, &weight) in weights.iter().enumerate() {
            let (tap, output) = (at / outputs, at % outputs);
            let step = output / OUTPUTS * dot::weights_len(WIDTH);
            let place = place(tap);
            let pair = &mut packed[step + dot::weight_at(output % OUTPUTS, place / 2)];
            *pair = pair.with(place % 2, weight.into());
        }
    }
}

/// Where tap (time, row, column) of 27 lies among the inputs of a position.
const fn place(tap: usize) -> usize {
    let (row, column) = (tap / 3, tap % 3);
    if column < 2 {
        2 * row + column
    } else {
        2 * 9 + row
    }
}
