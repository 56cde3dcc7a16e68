//! Gradient of a convolution's kernels.

use artifact::KERNEL;
use pulp::NullaryFnOnce;

use super::correlation::TAPS;
use super::volume::{Volume, product};
use super::{LANES, Lanes, add_products, total};

/// Number of channels of the small volume that are computed together, with the three columns of a kernel:
/// their sums fill the registers of AVX2.
const TILE: usize = 2;

/// Returns, for each channel a of `small`, each channel b of `large` and each tap k, the sum over all places
/// and windows of small\[a\]\[at\] large\[b\]\[at + k\].
///
/// # Panics
/// Unless `small` has an even number of channels and each axis of `large` is longer than that of `small` by
/// the kernel's length less 1.
pub(super) fn weight_gradient(small: &Volume, large: &Volume) -> Vec<f32> {
    assert!(
        small.channels.is_multiple_of(TILE),
        "an even number of channels"
    );
    for axis in 0..3 {
        assert_eq!(
            large.size[axis],
            small.size[axis] + KERNEL - 1,
            "axis {axis}"
        );
    }
    let mut gradient = vec![0.0; small.channels * large.channels * TAPS];
    pulp::Arch::new().dispatch(WeightGradient {
        small,
        large,
        gradient: &mut gradient,
    });
    gradient
}

/// The arguments, which pulp runs with the instructions that the processor has.
struct WeightGradient<'a> {
    small: &'a Volume,
    large: &'a Volume,
    gradient: &'a mut [f32],
}

impl NullaryFnOnce for WeightGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let [steps, rows, columns] = self.small.size;
        let places = product(self.small.size);
        let tiles = self.small.values.chunks_exact(TILE * places);
        let per_tile = TILE * self.large.channels * TAPS;
        for (small, gradient) in tiles.zip(self.gradient.chunks_exact_mut(per_tile)) {
            let (first, second) = small.split_at(places);
            for (b, large) in self.large.by_channel().enumerate() {
                for tap in 0..KERNEL * KERNEL {
                    let mut sums = [[0.0; LANES]; KERNEL];
                    let mut second_sums = [[0.0; LANES]; KERNEL];
                    for step in 0..steps {
                        for row in 0..rows {
                            let at = (step * rows + row) * columns;
                            let place =
                                (step + tap / KERNEL) * self.large.size[1] + row + tap % KERNEL;
                            let place = place * self.large.size[2];
                            let large = &large[place..place + columns + KERNEL - 1];
                            let first = &first[at..at + columns];
                            let second = &second[at..at + columns];
                            for column in 0..columns {
                                for k in 0..KERNEL {
                                    let x: &Lanes = &large[column + k];
                                    add_products(&mut sums[k], &first[column], x);
                                    add_products(&mut second_sums[k], &second[column], x);
                                }
                            }
                        }
                    }
                    for k in 0..KERNEL {
                        let at = b * TAPS + tap * KERNEL + k;
                        gradient[at] = total(&sums[k]);
                        gradient[self.large.channels * TAPS + at] = total(&second_sums[k]);
                    }
                }
            }
        }
    }
}
