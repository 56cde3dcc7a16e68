//! The last samples of many channels.

/// The last `TAPS` samples of each channel; silence before the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DelayLine<const CHANNELS: usize, const TAPS: usize> {
    /// Each channel's samples from `newest` on, wrapping around, are ever older.
    samples: [[i32; TAPS]; CHANNELS],
    newest: usize,
}

impl<const CHANNELS: usize, const TAPS: usize> DelayLine<CHANNELS, TAPS> {
    /// Nothing but silence so far.
    pub const SILENCE: Self = Self {
        samples: [[0; TAPS]; CHANNELS],
        newest: 0,
    };

    /// Takes the next sample of each channel, the oldest of each goes.
    #[inline]
    pub fn push(&mut self, samples: impl Iterator<Item = i32>) {
        let newest = self.newest().checked_sub(1).unwrap_or(TAPS - 1);
        self.newest = newest;
        for (line, sample) in self.samples.iter_mut().zip(samples) {
            line[newest] = sample;
        }
    }

    /// Where the newest samples stand; said so that the compiler knows it is within the line.
    #[inline]
    fn newest(&self) -> usize {
        self.newest.min(TAPS - 1)
    }

    /// For each channel the sum of its samples, weighted, the newest with the first weight; exact in
    /// 64 bits as long as the weights' magnitudes sum to less than 2^32.
    #[inline]
    pub(crate) fn weighted(&self, weights: &[i32; TAPS]) -> impl Iterator<Item = i64> {
        let newest = self.newest();
        let (newer_weights, older_weights) = weights.split_at(TAPS - newest);
        self.samples.iter().map(move |line| {
            let (older, newer) = line.split_at(newest);
            dot(newer_weights, newer) + dot(older_weights, older)
        })
    }
}

/// Taps that are multiplied in one round of the loop.
const ROUND: usize = 8;

#[inline]
fn dot(weights: &[i32], samples: &[i32]) -> i64 {
    let product = |(&weight, &sample): (&i32, &i32)| i64::from(weight) * i64::from(sample);
    let (weight_rounds, weight_rest) = weights.as_chunks::<ROUND>();
    let (sample_rounds, sample_rest) = samples.as_chunks::<ROUND>();
    let mut sum = 0;
    for (weights, samples) in weight_rounds.iter().zip(sample_rounds) {
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
    fn the_newest_sample_meets_the_first_weight_and_the_oldest_leaves() {
        let mut line = DelayLine::<2, 3>::SILENCE;
        let mut sums = Vec::new();
        for sample in 1..=5 {
            line.push([sample, -10 * sample].into_iter());
            sums.push(line.weighted(&[100, 10, 1]).collect::<Vec<_>>());
        }
        let ones: Vec<i64> = sums.iter().map(|sum| sum[0]).collect();
        assert_eq!(ones, [100, 210, 321, 432, 543]);
        assert!(sums.iter().all(|sum| sum[1] == -10 * sum[0]));
    }
}
