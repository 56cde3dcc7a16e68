//! Max-pooling of accumulators, and the way back to 8 bits.

use crate::{PlaneShape, requantise, saturate_u8};

/// The largest accumulator of each 2x2x2 block of two consecutive planes, requantised to `u8`.
///
/// `shape` is that of the accumulator planes; an odd last row or column is not read. The maximum is
/// taken on raw accumulators and requantised once: the same as requantising first, because both
/// steps are monotone, and for a negative multiplier it gives the *minimum* activation, which is
/// what a batch norm with a negative factor behind the ReLU needs (weights and bias negated).
///
/// # Panics
/// When a plane is shorter than its shape says or the shape has no channel; in debug builds also
/// when there is not one multiplier per channel.
pub fn max_pool(shape: PlaneShape, planes: [&[i32]; 2], multipliers: &[i32], pooled: &mut [u8]) {
    debug_assert_eq!(
        multipliers.len(),
        shape.channels,
        "one multiplier per channel"
    );
    let output = shape.pooled();
    for (position, outputs) in pooled[..output.len()]
        .chunks_exact_mut(output.channels)
        .enumerate()
    {
        let (row, column) = (
            2 * (position / output.columns),
            2 * (position % output.columns),
        );
        for (channel, (out, &multiplier)) in outputs.iter_mut().zip(multipliers).enumerate() {
            let mut largest = i32::MIN;
            for plane in planes {
                for at in [shape.at(row, column), shape.at(row + 1, column)] {
                    let pair = (plane[at + channel], plane[at + shape.channels + channel]);
                    largest = largest.max(pair.0).max(pair.1);
                }
            }
            *out = saturate_u8(requantise(largest, multiplier));
        }
    }
}

/// Requantises a plane of accumulators to `u8` (which is also the ReLU), one multiplier per
/// channel.
///
/// # Panics
/// When there are no multipliers; in debug builds also when the planes differ in length.
pub fn requantise_plane(accumulators: &[i32], multipliers: &[i32], plane: &mut [u8]) {
    debug_assert_eq!(
        accumulators.len(),
        plane.len(),
        "one activation per accumulator"
    );
    let channels = multipliers.len();
    for (sums, outputs) in accumulators
        .chunks_exact(channels)
        .zip(plane.chunks_exact_mut(channels))
    {
        for ((&sum, &multiplier), out) in sums.iter().zip(multipliers).zip(outputs) {
            *out = saturate_u8(requantise(sum, multiplier));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Multiplier 1/4.
    const QUARTER: i32 = 1 << 30;

    #[test]
    fn the_largest_of_eight_survives_and_the_odd_column_is_not_read() {
        let shape = PlaneShape {
            rows: 2,
            columns: 3,
            channels: 1,
        };
        let earlier = [4, 8, 9_999, 12, 16, 9_999];
        let later = [0, 40, 9_999, -4, 0, 9_999];
        let mut pooled = [0];
        max_pool(shape, [&earlier, &later], &[QUARTER], &mut pooled);
        assert_eq!(pooled, [10]);
    }

    #[test]
    fn a_negative_multiplier_on_negated_accumulators_keeps_the_smallest_activation() {
        let shape = PlaneShape {
            rows: 2,
            columns: 2,
            channels: 1,
        };
        let activations = [40, 8, 12, 16];
        let negated = activations.map(|a: i32| -a);
        let mut pooled = [0];
        max_pool(shape, [&negated, &negated], &[-QUARTER], &mut pooled);
        assert_eq!(pooled, [2]);
    }

    #[test]
    fn requantising_a_plane_is_per_channel_and_rectifies() {
        let mut plane = [0; 4];
        requantise_plane(&[40, 40, -40, 4_000], &[QUARTER, QUARTER / 2], &mut plane);
        assert_eq!(plane, [10, 5, 0, 255]);
    }
}
