//! Delay line of many channels: the samples that a FIR filter reads.

/// The last `TAPS` samples of each of `CHANNELS` channels; zeros before the first sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DelayLine<const CHANNELS: usize, const TAPS: usize> {
    /// Ring buffer of each channel: index `newest` holds the newest sample; earlier samples follow
    /// at increasing indices, modulo `TAPS`.
    samples: [[i32; TAPS]; CHANNELS],
    newest: usize,
}

impl<const CHANNELS: usize, const TAPS: usize> DelayLine<CHANNELS, TAPS> {
    /// A delay line full of zeros.
    pub const SILENCE: Self = Self {
        samples: [[0; TAPS]; CHANNELS],
        newest: 0,
    };

    /// Stores the next sample of each channel in place of its oldest one.
    #[inline]
    pub fn push(&mut self, samples: impl Iterator<Item = i32>) {
        let newest = self.newest().checked_sub(1).unwrap_or(TAPS - 1);
        self.newest = newest;
        for (line, sample) in self.samples.iter_mut().zip(samples) {
            line[newest] = sample;
        }
    }

    /// Returns the index of the newest samples; `min` lets the compiler drop the bounds checks.
    #[inline]
    fn newest(&self) -> usize {
        self.newest.min(TAPS - 1)
    }

    /// Returns the weighted sum of each channel's samples; `weights[0]` belongs to the newest
    /// sample.
    ///
    /// The sum is exact in 64 bits if the magnitudes of the weights sum to less than 2^32.
    #[inline]
    pub(crate) fn weighted_sums(&self, weights: &[i32; TAPS]) -> impl Iterator<Item = i64> {
        let newest = self.newest();
        let (newer_weights, older_weights) = weights.split_at(TAPS - newest);
        self.samples.iter().map(move |line| {
            let (older, newer) = line.split_at(newest);
            dot(newer_weights, newer) + dot(older_weights, older)
        })
    }
}

/// Products in one iteration of the unrolled loop.
const UNROLL: usize = 8;

#[inline]
fn dot(weights: &[i32], samples: &[i32]) -> i64 {
    let product = |(&weight, &sample): (&i32, &i32)| i64::from(weight) * i64::from(sample);
    let (weight_chunks, weight_rest) = weights.as_chunks::<UNROLL>();
    let (sample_chunks, sample_rest) = samples.as_chunks::<UNROLL>();
    let mut sum = 0;
    for (weights, samples) in weight_chunks.iter().zip(sample_chunks) {
        for pair in weights.iter().zip(samples) {
            sum += product(pair);
        }
    }
    for pair in weight_rest.iter().zip(sample_rest) {
        sum += product(pair);
    }
    sum
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn the_first_weight_belongs_to_the_newest_sample_and_the_oldest_is_dropped() {
        let mut line = DelayLine::<2, 3>::SILENCE;
        let mut sums = Vec::new();
        for sample in 1..=5 {
            line.push([sample, -10 * sample].into_iter());
            sums.push(line.weighted_sums(&[100, 10, 1]).collect::<Vec<_>>());
        }
        let ones: Vec<i64> = sums.iter().map(|sum| sum[0]).collect();
        assert_eq!(ones, [100, 210, 321, 432, 543]);
        assert!(sums.iter().all(|sum| sum[1] == -10 * sum[0]));
    }
}
