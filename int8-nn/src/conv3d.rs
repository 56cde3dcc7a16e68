//! Three-dimensional convolution, one output plane per call.

use crate::PlaneShape;

/// An unpadded 3x3x3 convolution over (time, row, column), stride 1.
#[derive(Clone, Copy, Debug)]
pub struct Conv3d<'w> {
    /// Shape of one input plane.
    pub input: PlaneShape,
    /// Number of output channels.
    pub output_channels: usize,
    /// `[time 3][row 3][column 3][input channel][output channel]`: the innermost loop runs over
    /// contiguous output channels.
    pub weights: &'w [i8],
    /// One per output channel, in accumulator steps.
    pub bias: &'w [i32],
}

impl Conv3d<'_> {
    /// Taps in each direction.
    pub const KERNEL: usize = 3;

    /// Shape of one output plane.
    pub const fn output(&self) -> PlaneShape {
        self.input.convolved(self.output_channels)
    }

    /// True when this convolution maps `input` to `output` and weights and bias have the lengths
    /// that this asks for; assert it in `const`.
    pub const fn is_consistent(&self, input: PlaneShape, output: PlaneShape) -> bool {
        self.input.equals(input)
            && self.output().equals(output)
            && self.output_channels > 0
            && self.weights.len() == 27 * self.input.channels * self.output_channels
            && self.bias.len() == self.output_channels
    }

    /// Writes one output plane of accumulators from the three input planes that end with it,
    /// oldest first.
    ///
    /// `planes` hold `input.len()` elements each, `accumulators` `output().len()`; every output is
    /// bias + sum of 27 * channels products, wrapping.
    ///
    /// # Panics
    /// When a slice is shorter than its shape says; with [`Conv3d::is_consistent`] only the
    /// arguments can be.
    pub fn plane<T: Copy + Into<i32>>(&self, planes: [&[T]; 3], accumulators: &mut [i32]) {
        let output = self.output();
        let outputs = self.output_channels;
        let row_taps = Self::KERNEL * self.input.channels;
        for (position, sums) in accumulators[..output.len()]
            .chunks_exact_mut(outputs)
            .enumerate()
        {
            let (row, column) = (position / output.columns, position % output.columns);
            sums.copy_from_slice(self.bias);
            let mut weights = self.weights.chunks_exact(outputs);
            for plane in planes {
                for tap_row in 0..Self::KERNEL {
                    let start = self.input.at(row + tap_row, column);
                    let taps = &plane[start..start + row_taps];
                    for (&x, weights) in taps.iter().zip(&mut weights) {
                        multiply_add(sums, x.into(), weights);
                    }
                }
            }
        }
    }
}

/// `sums += x * weights`, wrapping.
#[inline]
pub(crate) fn multiply_add(sums: &mut [i32], x: i32, weights: &[i8]) {
    for (sum, &weight) in sums.iter_mut().zip(weights) {
        *sum = sum.wrapping_add(x * i32::from(weight));
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;

    #[test]
    fn one_weight_picks_one_tap() {
        let input = PlaneShape {
            rows: 4,
            columns: 5,
            channels: 2,
        };
        let mut weights = vec![0_i8; 27 * 2 * 3];
        // Tap (time 2, row 1, column 0), input channel 1, output channel 2.
        weights[(((2 * 3 + 1) * 3) * 2 + 1) * 3 + 2] = 7;
        let conv = Conv3d {
            input,
            output_channels: 3,
            weights: &weights,
            bias: &[10, 20, 30],
        };
        assert!(conv.is_consistent(
            input,
            PlaneShape {
                rows: 2,
                columns: 3,
                channels: 3
            }
        ));
        let latest: vec::Vec<u8> = (0..40).collect();
        let zero = vec![0_u8; 40];
        let mut sums = vec![0; conv.output().len()];
        conv.plane([&zero, &zero, &latest], &mut sums);
        for row in 0..2 {
            for column in 0..3 {
                let tap = i32::from(latest[input.at(row + 1, column) + 1]);
                let at = conv.output().at(row, column);
                assert_eq!(sums[at..at + 3], [10, 20, 30 + 7 * tap]);
            }
        }
    }
}
