//! Correlation of a volume with 3 x 3 x 3 kernels: the work of every convolution, forward and backward.

use artifact::KERNEL;
use pulp::NullaryFnOnce;

use super::volume::{Volume, product};
use super::{LANES, Lanes, add_scaled};

/// Number of output channels that are computed together: their sums fill the registers of AVX2.
const TILE: usize = 4;
/// Number of values of a kernel.
pub(super) const TAPS: usize = KERNEL * KERNEL * KERNEL;

/// Kernels in the order in which [`correlate`] reads them: tile of outputs, input, tap, output of the tile.
#[derive(Clone, Debug)]
pub(super) struct Kernels {
    outputs: usize,
    inputs: usize,
    tile: usize,
    values: Vec<f32>,
}

impl Kernels {
    /// Arranges kernels; `value` returns that from an input channel to an output channel at a tap, the
    /// index of step, row and column (the last fastest).
    pub(super) fn new(
        outputs: usize,
        inputs: usize,
        value: impl Fn(usize, usize, usize) -> f32,
    ) -> Self {
        let tile = if outputs.is_multiple_of(TILE) {
            TILE
        } else {
            1
        };
        let mut values = Vec::with_capacity(outputs * inputs * TAPS);
        for first in (0..outputs).step_by(tile) {
            for input in 0..inputs {
                for tap in 0..TAPS {
                    values.extend((first..first + tile).map(|output| value(output, input, tap)));
                }
            }
        }
        Self {
            outputs,
            inputs,
            tile,
            values,
        }
    }
}

/// Returns the correlation of `x`, surrounded by `pads` zeros along each axis, with the kernels, plus a
/// number for each output channel: y\[o\]\[at\] = bias\[o\] + sum over i and k of w\[o\]\[i\]\[k\] x\[i\]\[at +
/// k - pads\].
pub(super) fn correlate(x: &Volume, kernels: &Kernels, bias: &[f32], pads: [usize; 3]) -> Volume {
    assert_eq!(
        x.channels, kernels.inputs,
        "a kernel for each input channel"
    );
    let output = |axis: usize| x.size[axis] + 2 * pads[axis] + 1 - KERNEL;
    let mut y = Volume::zeros(kernels.outputs, [0, 1, 2].map(output));
    pulp::Arch::new().dispatch(Correlate {
        x,
        kernels,
        bias,
        pads,
        y: &mut y,
    });
    y
}

/// The arguments of a correlation, which pulp runs with the instructions that the processor has.
struct Correlate<'a> {
    x: &'a Volume,
    kernels: &'a Kernels,
    bias: &'a [f32],
    pads: [usize; 3],
    y: &'a mut Volume,
}

impl NullaryFnOnce for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        if self.kernels.tile == TILE {
            self.run::<TILE>();
        } else {
            self.run::<1>();
        }
    }
}

/// Taps along one axis that meet the input at one place of the output.
#[derive(Clone, Copy)]
struct Reach {
    /// First tap.
    first: usize,
    /// Number of taps.
    count: usize,
    /// Place of the input that the first tap meets.
    input: usize,
}

impl Reach {
    #[inline(always)]
    fn new(at: usize, pad: usize, length: usize) -> Self {
        let first = pad.saturating_sub(at);
        let end = KERNEL.min(length + pad - at);
        Self {
            first,
            count: end - first,
            input: at + first - pad,
        }
    }
}

impl Correlate<'_> {
    #[inline(always)]
    fn run<const T: usize>(&mut self) {
        let [_, rows, columns] = self.x.size;
        let [out_steps, out_rows, out_columns] = self.y.size;
        let out_places = product(self.y.size);
        let per_tile = self.kernels.inputs * TAPS * T;
        for (tile, bias) in self.bias.as_chunks::<T>().0.iter().enumerate() {
            let kernels = &self.kernels.values[tile * per_tile..(tile + 1) * per_tile];
            let mut at = 0;
            for step in 0..out_steps {
                let in_step = Reach::new(step, self.pads[0], self.x.size[0]);
                for row in 0..out_rows {
                    let in_row = Reach::new(row, self.pads[1], rows);
                    for column in 0..out_columns {
                        let in_column = Reach::new(column, self.pads[2], columns);
                        let reach = [in_step, in_row, in_column];
                        let start: [Lanes; T] = bias.map(|bias| [bias; LANES]);
                        let sums = match in_column.count {
                            1 => self.sums::<T, 1>(kernels, reach, start),
                            2 => self.sums::<T, 2>(kernels, reach, start),
                            _ => self.sums::<T, KERNEL>(kernels, reach, start),
                        };
                        for (output, sums) in sums.iter().enumerate() {
                            self.y.values[(tile * T + output) * out_places + at] = *sums;
                        }
                        at += 1;
                    }
                }
            }
        }
    }

    /// Returns the sums of one place of `T` output channels, which meets `C` columns of each kernel.
    #[inline(always)]
    fn sums<const T: usize, const C: usize>(
        &self,
        kernels: &[f32],
        [step, row, column]: [Reach; 3],
        mut sums: [Lanes; T],
    ) -> [Lanes; T] {
        let [_, rows, columns] = self.x.size;
        let inputs = self.x.values.chunks_exact(product(self.x.size));
        for (x, w) in inputs.zip(kernels.chunks_exact(TAPS * T)) {
            for t in 0..step.count {
                for r in 0..row.count {
                    let place = (step.input + t) * rows + row.input + r;
                    let tap = (step.first + t) * KERNEL + row.first + r;
                    let x = x[place * columns + column.input..].first_chunk::<C>();
                    let w = w[(tap * KERNEL + column.first) * T..]
                        .as_chunks::<T>()
                        .0
                        .first_chunk::<C>();
                    if let (Some(x), Some(w)) = (x, w) {
                        for c in 0..C {
                            for output in 0..T {
                                add_scaled(&mut sums[output], w[c][output], &x[c]);
                            }
                        }
                    }
                }
            }
        }
        sums
    }
}
