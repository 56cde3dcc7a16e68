//! The layers of the autoencoder, forward and backward, for 16 windows at a time.
//!
//! A value of a feature map is an array of [`LANES`] numbers, one for each window of a group. So the loops
//! over the windows are vector instructions whatever the sizes of the feature maps, and no layer copies its
//! input into a matrix first.
//!
//! ```text
//! Volume: channel, step, row, column, lane (the last fastest)
//! ```
//!
//! Every product is added by a fused multiply-add, and in an order that does not depend on the processor or
//! the number of threads: the same parameters and windows yield the same bits everywhere.

pub(crate) mod batch_norm;
pub(crate) mod convolution;
mod correlation;
pub(crate) mod linear;
pub(crate) mod pool;
pub(crate) mod volume;
mod weight_gradient;

/// Number of windows in a group.
pub(crate) const LANES: usize = 16;
/// One value of each window of a group.
pub(crate) type Lanes = [f32; LANES];

/// Adds `factor * values` to `sums`, lane by lane.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "its callers enable the processor's instructions"
)]
pub(crate) fn add_scaled(sums: &mut Lanes, factor: f32, values: &Lanes) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum = factor.mul_add(*value, *sum);
    }
}

/// Returns the sum over all lanes, in pairs: 8 and 8, 4 and 4, 2 and 2, 1 and 1.
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
