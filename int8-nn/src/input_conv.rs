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
/// Groups that the loop takes in one turn.
const TURN: usize = 4;
/// Pairs that the inputs of a group of positions take.
const GROUP: usize = POSITIONS * WIDTH;

/// A 3x3x3 convolution of one channel over (time, row, column), stride 1, unpadded, with ReLU, one
/// plane per call.
///
/// Each position's 27 inputs are laid side by side first; the products then run through them as
/// those of any other layer do. `COLUMNS` are those of the input, known when the kernel is compiled
/// so that one pointer reaches all rows of a plane.
#[derive(Clone, Copy, Debug)]
pub struct InputConv<'w, const COLUMNS: usize> {
    /// Rows of an input plane.
    pub rows: usize,
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

impl<const COLUMNS: usize> InputConv<'_, COLUMNS> {
    /// Shape of an input plane.
    pub const fn input(&self) -> PlaneShape {
        PlaneShape {
            rows: self.rows,
            columns: COLUMNS,
            channels: 1,
        }
    }

    /// Pairs in the packed weights of so many outputs.
    pub const fn weights_len(outputs: usize) -> usize {
        outputs * WIDTH
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
        self.input().equals(input)
            && self.output.equals(output)
            && !output.is_empty()
            && output.rows + 2 <= input.rows
            && output.columns + 2 <= input.columns
            && output.channels.is_multiple_of(OUTPUTS)
            && self.weights.len() == Self::weights_len(output.channels)
            && self.bias.len() == output.channels
            && self.multipliers.len() == output.channels
    }

    /// Groups of as many positions as are multiplied together; the last ones may have positions that
    /// nobody reads.
    const fn groups(&self) -> usize {
        (self.output.rows * self.output.columns)
            .div_ceil(POSITIONS)
            .next_multiple_of(TURN)
    }

    /// Writes the output plane, values 0..=255, `[pair of channels][row][column]`, that ends with the
    /// last of three input planes as [`Self::pair_up`] makes them, oldest first. `patches` and `sums`
    /// are scratch.
    ///
    /// # Panics
    /// When a slice is shorter than its shape says, or weights, bias and factors are not as many as
    /// the outputs ask for: [`Self::is_consistent`].
    pub fn plane(
        &self,
        planes: [&[Pair]; 3],
        patches: &mut [Pair],
        sums: &mut [i32],
        output: &mut [Pair],
    ) {
        assert!(
            self.is_consistent(self.input(), self.output),
            "whole pairs of outputs, and as many weights"
        );
        let patches = &mut patches[..self.patches_len()];
        let sums = &mut sums[..self.sums_len()];
        let output = &mut output[..self.output.len() / OUTPUTS];
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
            dots::<1, WIDTH, WIDTH>([patches], weights, sums.as_chunks_mut().0);
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
        let plane = &plane[..self.input().len()];
        let pairs = &mut pairs[..plane.len()];
        for (pair, neighbours) in pairs.iter_mut().zip(plane.windows(2)) {
            *pair = Pair::new([neighbours[0].into(), neighbours[1].into()]);
        }
        if let (Some(pair), Some(&last)) = (pairs.last_mut(), plane.last()) {
            *pair = Pair::new([last.into(), 0]);
        }
    }

    /// Lays the inputs of each position side by side: of each (time, row) the first two columns, then
    /// the third ones, two rows in a pair, and a zero.
    fn lay_out(&self, planes: [&[Pair]; 3], patches: &mut [Pair]) {
        /// From a position's first input to its last.
        const fn reach(columns: usize) -> usize {
            2 * columns + 3
        }
        let columns = self.output.columns;
        let rows = patches.chunks_mut(columns * WIDTH).take(self.output.rows);
        for (row, patches) in rows.enumerate() {
            let [a, b, c] = planes.map(|plane| {
                let rows = &plane[row * COLUMNS..][..columns - 1 + reach(COLUMNS)];
                rows.windows(reach(COLUMNS))
            });
            let inputs = a.zip(b).zip(c);
            for (((a, b), c), patch) in inputs.zip(patches.as_chunks_mut::<WIDTH>().0) {
                let [a, b, c] = [a, b, c].map(|window| {
                    [0, COLUMNS, 2 * COLUMNS].map(|row| [window[row], window[row + 2]])
                });
                *patch = [
                    a[0][0],
                    a[1][0],
                    a[2][0],
                    b[0][0],
                    b[1][0],
                    b[2][0],
                    c[0][0],
                    c[1][0],
                    c[2][0],
                    a[0][1].first_of(a[1][1]),
                    a[2][1].first_of(b[0][1]),
                    b[1][1].first_of(b[2][1]),
                    c[0][1].first_of(c[1][1]),
                    c[2][1].first_of(Pair::ZERO),
                ];
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
