//! Rate reduction by a rational factor with a polyphase FIR filter, and the delay line that stores
//! the filter's input.

/// A polyphase FIR filter: output rate = input rate * `PHASES` / `down`, in lowest terms.
///
/// The underlying low-pass has `PHASES * TAPS` taps at `PHASES` times the input rate; each output
/// needs `TAPS` of these taps. Output `m` is the signal at time `m * down / PHASES`, in input
/// intervals after the first sample. It is computed from the input samples up to that time. The
/// phase of an output is the time since the newest of these samples, in 1 / `PHASES` of the input
/// interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resampler<const PHASES: usize, const TAPS: usize> {
    /// Number of input samples for every `PHASES` output samples; at least `PHASES`.
    pub down: u16,
    /// Impulse response, Q2.30, `[phase][age]`, where age 0 belongs to the newest input sample.
    pub taps: [[i32; TAPS]; PHASES],
}

/// When a resampler's next output is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Time from the next input sample to the next output, in units of the input period divided by
    /// `PHASES`.
    ahead: u16,
}

impl Position {
    /// Position of a resampler that has had no input sample yet.
    pub const START: Self = Self { ahead: 0 };
}

impl Resampler<1, 1> {
    /// Returns a resampler that keeps the first sample and every `down`-th sample after it without
    /// filtering, so that signals above half of the output rate alias.
    ///
    /// # Panics
    /// If `down` is 0; at compile time in a `const` context.
    pub const fn every(down: u16) -> Self {
        assert!(down > 0, "`down` must be at least 1");
        Self { down, taps: [[Self::UNITY]] }
    }
}

impl<const PHASES: usize, const TAPS: usize> Resampler<PHASES, TAPS> {
    /// A tap of 1.0 in Q2.30.
    pub const UNITY: i32 = 1 << 30;

    /// Returns true if each input yields at most one output and no input can overflow the 64-bit
    /// accumulator.
    pub const fn is_consistent(&self) -> bool {
        let mut consistent = TAPS > 0 && PHASES > 0 && PHASES <= self.down as usize;
        let mut phase = 0;
        while phase < PHASES {
            let mut magnitude = 0;
            let mut age = 0;
            while age < TAPS {
                magnitude += self.taps[phase][age].unsigned_abs() as u64;
                age += 1;
            }
            // If the magnitudes of the taps sum to less than 2^31, products with samples of at most
            // 2^31 sum to less than 2^62; rounding adds 2^29.
            consistent = consistent && magnitude < 1 << 31;
            phase += 1;
        }
        consistent
    }

    /// Advances by one input sample. If an output is due before the next sample, returns the
    /// output's phase: its time after this sample, in 1 / `PHASES` of the interval between input
    /// samples.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "PHASES <= down, which has 16 bits")]
    pub const fn advance(&self, position: &mut Position) -> Option<usize> {
        let parts = const { PHASES as u16 };
        if position.ahead < parts {
            let phase = position.ahead;
            position.ahead = phase + (self.down - parts);
            Some(phase as usize)
        } else {
            position.ahead -= parts;
            None
        }
    }

    /// Returns the output of every channel at `phase`, in the samples' unit and format.
    ///
    /// The 64-bit sum is exact and rounded half up once. Overflow wraps, so the caller must prove
    /// |output| < 2^31.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the caller proves that the output fits 32 bits"
    )]
    pub fn outputs<const CHANNELS: usize>(
        &self,
        phase: usize,
        line: &DelayLine<CHANNELS, TAPS>,
    ) -> [i32; CHANNELS] {
        let mut outputs = [0; CHANNELS];
        for (output, sum) in outputs.iter_mut().zip(line.weighted_sums(&self.taps[phase % PHASES]))
        {
            *output = ((sum + i64::from(Self::UNITY / 2)) >> 30) as i32;
        }
        outputs
    }
}

/// The last `TAPS` samples of each of `CHANNELS` channels; all are 0 before the first sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DelayLine<const CHANNELS: usize, const TAPS: usize> {
    /// Ring buffer of each channel: index `newest` holds the newest sample, and the indices after
    /// it (modulo `TAPS`) hold ever older samples.
    samples: [[i32; TAPS]; CHANNELS],
    newest: usize,
}

impl<const CHANNELS: usize, const TAPS: usize> DelayLine<CHANNELS, TAPS> {
    /// A delay line whose samples are all 0.
    pub const SILENCE: Self = Self { samples: [[0; TAPS]; CHANNELS], newest: 0 };

    /// Stores the next sample of each channel in place of its oldest one.
    #[inline]
    pub fn push(&mut self, samples: impl Iterator<Item = i32>) {
        let newest = self.newest().checked_sub(1).unwrap_or(TAPS - 1);
        self.newest = newest;
        for (line, sample) in self.samples.iter_mut().zip(samples) {
            line[newest] = sample;
        }
    }

    /// Returns the index of the newest samples; `min` proves to the compiler that it is in bounds.
    #[inline]
    fn newest(&self) -> usize {
        self.newest.min(TAPS - 1)
    }

    /// Returns the weighted sum of each channel's samples; `weights[0]` is for the newest sample.
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

/// Number of products in one iteration of the unrolled loop.
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
    fn the_first_and_every_fourth_sample_after_it_pass_unchanged() {
        let resampler = Resampler::every(4);
        let (mut position, mut line) = (Position::START, DelayLine::<1, 1>::SILENCE);
        let kept: Vec<i32> = [i32::MIN, 1, 2, 3, -4, 5, 6, 7, i32::MAX]
            .into_iter()
            .filter_map(|sample| {
                line.push([sample].into_iter());
                let phase = resampler.advance(&mut position)?;
                Some(resampler.outputs(phase, &line)[0])
            })
            .collect();
        assert_eq!(kept, [i32::MIN, -4, i32::MAX]);
    }

    #[test]
    fn outputs_are_due_at_multiples_of_the_ratio_with_the_sample_before() {
        // From 500 Hz to 128 Hz, outputs are 125 / 32 = 3.90625 input samples apart.
        let resampler = Resampler { down: 125, taps: [[0]; 32] };
        let mut position = Position::START;
        let due: Vec<(usize, usize)> = (0..1_000)
            .filter_map(|sample| Some((sample, resampler.advance(&mut position)?)))
            .collect();
        let expected: Vec<(usize, usize)> =
            (0..256).map(|output| (output * 125 / 32, output * 125 % 32)).collect();
        assert_eq!(due, expected);
    }

    #[test]
    fn a_resampler_that_raises_the_rate_or_could_overflow_is_inconsistent() {
        let unity = Resampler::<1, 1>::UNITY;
        assert!(Resampler::every(1).is_consistent());
        assert!(!Resampler { down: 2, taps: [[unity]; 3] }.is_consistent());
        assert!(!Resampler { down: 4, taps: [[unity, -unity]] }.is_consistent());
    }

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
