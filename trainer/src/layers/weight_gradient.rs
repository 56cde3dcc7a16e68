//! Gradient of a convolution's kernels.

use artifact::KERNEL;
use pulp::{Simd, WithSimd};

use super::correlation::TAPS;
use super::volume::{Volume, product};
use super::{LANES, total};

/// Number of channels of the small volume that are computed together: their sums fill the registers of AVX2.
const TILE: usize = 4;

/// Returns, for each channel a of `small`, each channel b of `large` and each tap k, the sum over all places
/// and windows of small\[a\]\[at\] large\[b\]\[at + k\].
///
/// # Panics
/// Unless `small` has a multiple of 4 channels and each axis of `large` is longer than that of `small` by
/// the kernel's length less 1.
pub(super) fn weight_gradient(small: &Volume, large: &Volume) -> Vec<f32> {
    assert!(
        small.channels.is_multiple_of(TILE),
        "a multiple of {TILE} channels"
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

impl WithSimd for WeightGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (small, _) = S::as_simd_f32s(self.small.values.as_flattened());
        let (large, _) = S::as_simd_f32s(self.large.values.as_flattened());
        let [_, rows, columns] = self.large.size;
        let parts = LANES / S::F32_LANES;
        let small_places = product(self.small.size) * parts;
        let large_places = product(self.large.size) * parts;
        let per_tile = TILE * self.large.channels * TAPS;
        let tiles = small.chunks_exact(TILE * small_places);
        for (small, gradient) in tiles.zip(self.gradient.chunks_exact_mut(per_tile)) {
            for (b, large) in large.chunks_exact(large_places).enumerate() {
                for tap in 0..KERNEL * KERNEL {
                    let first = (tap / KERNEL * rows + tap % KERNEL) * columns * parts;
                    let mut sums = [[[0.0; LANES]; KERNEL]; TILE];
                    for part in 0..parts {
                        let vectors = Vectors {
                            small: &small[part..],
                            small_size: self.small.size,
                            large: &large[first + part..],
                            large_size: self.large.size,
                            parts,
                        };
                        let part_sums = vectors.sums(simd);
                        for (lanes, sum) in sums
                            .iter_mut()
                            .flatten()
                            .zip(part_sums.into_iter().flatten())
                        {
                            S::as_mut_simd_f32s(lanes).0[part] = sum;
                        }
                    }
                    for (a, sums) in sums.iter().enumerate() {
                        for (k, lanes) in sums.iter().enumerate() {
                            let at = (a * self.large.channels + b) * TAPS + tap * KERNEL + k;
                            gradient[at] = total(lanes);
                        }
                    }
                }
            }
        }
    }
}

/// The vectors of a part of the windows, from the place that a step and row of the kernel meet first.
struct Vectors<'a, V> {
    small: &'a [V],
    small_size: [usize; 3],
    large: &'a [V],
    large_size: [usize; 3],
    /// Number of vectors in a group of windows.
    parts: usize,
}

impl<V: Copy> Vectors<'_, V> {
    /// Returns the sums for a tile of channels of the small volume and the columns of a kernel.
    #[inline(always)]
    fn sums<S: Simd<f32s = V>>(&self, simd: S) -> [[V; KERNEL]; TILE] {
        let [steps, rows, columns] = self.small_size;
        let places = steps * rows * columns;
        let mut sums = [[simd.splat_f32s(0.0); KERNEL]; TILE];
        for step in 0..steps {
            for row in 0..rows {
                let at = (step * rows + row) * columns;
                let place = (step * self.large_size[1] + row) * self.large_size[2];
                for column in 0..columns {
                    let x: [V; KERNEL] =
                        std::array::from_fn(|k| self.large[(place + column + k) * self.parts]);
                    for (a, sums) in sums.iter_mut().enumerate() {
                        let y = self.small[(a * places + at + column) * self.parts];
                        for (sum, x) in sums.iter_mut().zip(x) {
                            *sum = simd.mul_add_f32s(y, x, *sum);
                        }
                    }
                }
            }
        }
        sums
    }
}
