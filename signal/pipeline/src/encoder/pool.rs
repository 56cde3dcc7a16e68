//! The second convolution and its max-pool.

use int8_nn::{Pair, requantise, saturate_u8};
use model::{Conv2, Network, POOLED, POOLED_PAIRS};

/// The largest sums of the current pool, and the last complete pooled plane.
#[derive(Clone, Debug)]
pub(super) struct Pool {
    largest: [i32; POOLED.len()],
    pooled: [Pair; POOLED_PAIRS],
}

impl Pool {
    /// All zeros, so that a static encoder takes no flash; call [`Self::start`] before the first plane.
    pub(super) const EMPTY: Self = Self {
        largest: [0; POOLED.len()],
        pooled: [Pair::ZERO; POOLED_PAIRS],
    };

    /// Resets the largest sums to `i32::MIN`, before the first plane of a pool.
    pub(super) fn start(&mut self) {
        self.largest.fill(i32::MIN);
    }

    /// Convolves three transformed planes, oldest first, and updates the largest sums of the pool.
    #[inline]
    pub(super) fn convolve(&mut self, network: &Network<'_>, transformed: [&[Pair]; 3]) {
        network
            .conv2()
            .convolve_max_pool(transformed, &mut self.largest);
    }

    /// Adds the bias to the largest sums, requantises them to 0..=255 and resets them for the next
    /// pool.
    #[inline]
    pub(super) fn requantise(&mut self, network: &Network<'_>) {
        let bias = network.conv2.bias.as_chunks::<2>().0;
        let multipliers = network.conv2.multipliers.as_chunks::<2>().0;
        let places = self.largest.chunks_exact_mut(POOLED.channels);
        for (sums, pooled) in places.zip(self.pooled.chunks_exact_mut(POOLED.channels / 2)) {
            let channels = bias.iter().zip(multipliers);
            let sums = sums.as_chunks_mut::<2>().0.iter_mut().zip(channels);
            for (pair, (sums, (bias, multipliers))) in pooled.iter_mut().zip(sums) {
                let activation = |index: usize| {
                    let sum = Conv2::unscaled(sums[index]).wrapping_add(bias[index]);
                    i16::from(saturate_u8(requantise(sum, multipliers[index])))
                };
                *pair = Pair::new([activation(0), activation(1)]);
                *sums = [i32::MIN; 2];
            }
        }
    }

    /// Returns the last complete pooled plane, values 0..=255, `[position][channel]`.
    #[inline]
    pub(super) const fn pooled(&self) -> &[Pair; POOLED_PAIRS] {
        &self.pooled
    }
}
