//! The layers of the autoencoder, forward and backward, for 16 windows at a time.
//!
//! A value of a feature map is an array of [`LANES`] numbers, one for each window of a group. The
//! loops over the windows therefore become vector instructions for all sizes of feature maps, and
//! no layer copies its input into a matrix first.
//!
//! ```text
//! Volume: channel, step, row, column, lane (the last fastest)
//! ```
//!
//! Every product is added by a fused multiply-add, in an order that does not depend on the
//! processor or the number of threads: the same parameters and windows yield the same bits
//! everywhere.

#![expect(
    clippy::inline_always,
    reason = "pulp enables the processor's instructions for what is inlined into its functions"
)]

pub(crate) mod batch_norm;
pub(crate) mod convolution;
pub(crate) mod linear;
pub(crate) mod pool;

/// Number of windows in a group.
pub(crate) const LANES: usize = 16;
/// One value of a feature map, for each window of a group.
pub(crate) type Lanes = [f32; LANES];

/// Adds `factor * values` to `sums`, lane by lane.
#[inline(always)]
pub(crate) fn add_scaled(sums: &mut Lanes, factor: f32, values: &Lanes) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum = factor.mul_add(*value, *sum);
    }
}

/// Returns the sum of all lanes, added in pairs: 8 and 8 lanes, then 4 and 4, 2 and 2, 1 and 1.
pub(crate) fn total(lanes: &Lanes) -> f32 {
    let mut sums = *lanes;
    let mut length = LANES;
    while length > 1 {
        length /= 2;
        for at in 0..length {
            sums[at] += sums[at + length];
        }
    }
    sums[0]
}

/// A feature map of [`LANES`] windows: channel, step, row, column, lane (the last fastest).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Volume {
    pub(crate) channels: usize,
    /// Numbers of steps, rows and columns.
    pub(crate) size: [usize; 3],
    /// Values of the feature map, column fastest, then row, step and channel.
    pub(crate) values: Vec<Lanes>,
}

impl Volume {
    pub(crate) fn zeros(channels: usize, size: [usize; 3]) -> Self {
        Self::from_values(channels, size, vec![[0.0; LANES]; channels * product(size)])
    }

    /// Creates a volume from its values.
    ///
    /// # Panics
    /// If `values` does not have one element for each position of each channel.
    pub(crate) fn from_values(channels: usize, size: [usize; 3], values: Vec<Lanes>) -> Self {
        assert_eq!(values.len(), channels * product(size), "a value for each place");
        Self { channels, size, values }
    }

    /// Returns the number of positions (step, row, column): the number of values in each channel.
    pub(crate) fn places(&self) -> usize {
        product(self.size)
    }

    pub(crate) fn by_channel(&self) -> impl Iterator<Item = &[Lanes]> {
        self.values.chunks_exact(self.places().max(1))
    }

    /// Iterates over the values of each channel by mutable reference.
    pub(crate) fn by_channel_mut(&mut self) -> impl Iterator<Item = &mut [Lanes]> {
        let places = self.places().max(1);
        self.values.chunks_exact_mut(places)
    }

    /// Returns a copy with `pads` zeros added at both ends of each axis.
    pub(crate) fn padded(&self, pads: [usize; 3]) -> Self {
        let [steps, rows, columns] = self.size;
        let size = [steps + 2 * pads[0], rows + 2 * pads[1], columns + 2 * pads[2]];
        let mut padded = Self::zeros(self.channels, size);
        for (source, target) in self.by_channel().zip(padded.by_channel_mut()) {
            for (at, row) in source.chunks_exact(columns.max(1)).enumerate() {
                let step = at / rows + pads[0];
                let start = (step * size[1] + at % rows + pads[1]) * size[2] + pads[2];
                target[start..start + columns].copy_from_slice(row);
            }
        }
        padded
    }

    /// Sets negative values to 0 (ReLU).
    pub(crate) fn rectify(&mut self) {
        for value in self.values.as_flattened_mut() {
            *value = value.max(0.0);
        }
    }

    /// Sets values to 0 where `activation`, the output of a ReLU, is 0. This turns a gradient at
    /// the output of the ReLU into the gradient at its input.
    pub(crate) fn rectify_gradient(&mut self, activation: &Self) {
        let active = activation.values.as_flattened();
        for (gradient, active) in self.values.as_flattened_mut().iter_mut().zip(active) {
            *gradient = if *active > 0.0 { *gradient } else { 0.0 };
        }
    }
}

/// Returns the number of positions in a volume of this size.
pub(crate) fn product(size: [usize; 3]) -> usize {
    size.iter().product()
}
