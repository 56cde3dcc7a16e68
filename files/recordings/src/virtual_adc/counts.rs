//! Converts microvolts to counts, and dithers repeated counts.

use std::ops::RangeInclusive;

use super::CHANNELS;

/// Smallest and largest output of a 24-bit ADC, counts.
const RAILS: RangeInclusive<f64> = -8_388_608.0..=8_388_607.0;

/// Largest number of samples converted together. At this size, one channel's values and the counts
/// of all channels fit a processor's first-level cache.
const SAMPLES: usize = 64;

/// A block of ADC samples. Microvolts are converted to counts one channel at a time, over all
/// samples of the block, because the compiler vectorises such a loop.
pub(super) struct CountBlock {
    counts: [[i32; CHANNELS]; SAMPLES],
    /// Number of channels of each sample that were beyond the rails.
    saturated: [u64; SAMPLES],
    /// Number of samples in the block.
    length: usize,
    /// Number of samples of the block that have been delivered.
    delivered: usize,
}

impl CountBlock {
    pub(super) fn new() -> Self {
        Self { counts: [[0; CHANNELS]; SAMPLES], saturated: [0; SAMPLES], length: 0, delivered: 0 }
    }

    /// Returns whether all samples have been delivered.
    pub(super) fn is_empty(&self) -> bool {
        self.delivered == self.length
    }

    /// Clears the block, sets its length to at most `ready` samples, and returns this length.
    pub(super) fn start(&mut self, ready: usize) -> usize {
        *self = Self::new();
        self.length = ready.min(SAMPLES);
        self.length
    }

    /// Converts one channel, for all samples of the block. The channel's value is the sum of
    /// `terms`, added in their order; each term is the values of a signal in uV, one for each
    /// sample, and the signal's weight.
    pub(super) fn convert<'v>(
        &mut self,
        channel: usize,
        terms: impl Iterator<Item = (&'v [f64], f64)>,
        lsb_uv: f64,
    ) {
        // Sums start at -0.0, as in the standard library, because -0.0 + x is x even if x is -0.0.
        let mut sums = [-0.0; SAMPLES];
        for (values, weight) in terms {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += value * weight;
            }
        }
        let samples = self.counts.iter_mut().zip(&mut self.saturated);
        for ((counts, saturated), sum) in samples.zip(sums).take(self.length) {
            let unlimited = sum / lsb_uv;
            counts[channel] = rounded(unlimited.clamp(*RAILS.start(), *RAILS.end()));
            // False if the value rounds to a count beyond the rails.
            let inside = unlimited > *RAILS.start() - 0.5 && unlimited < *RAILS.end() + 0.5;
            *saturated += u64::from(!inside);
        }
    }

    /// Returns the next sample, and the number of its channels that were beyond the rails. Both are
    /// zero if the block is empty.
    pub(super) fn next(&mut self) -> ([i32; CHANNELS], u64) {
        let at = self.delivered;
        let (Some(counts), Some(saturated)) = (self.counts.get(at), self.saturated.get(at)) else {
            return ([0; CHANNELS], 0);
        };
        self.delivered += 1;
        (*counts, *saturated)
    }
}

/// Rounds to the nearest integer, ties away from zero, as `f64::round` does. `value` must be within
/// [`RAILS`]. This form vectorises; many processors have no vector instruction for `f64::round`.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "within i24")]
fn rounded(value: f64) -> i32 {
    let whole = value as i32;
    // The subtraction is exact, because |whole| <= |value| < 2^24.
    let fraction = value - f64::from(whole);
    whole + i32::from(fraction >= 0.5) - i32::from(fraction <= -0.5)
}

/// Number of channels of one chip (ADS1299) of the ADC.
const CONVERTER_CHANNELS: usize = 8;

/// Adds one count where all channels of a chip would repeat their last sample.
///
/// A real chip has noise, so its driver reports eight repeated counts as a frozen chip. A recording
/// can be flat or of low resolution, so its samples can repeat exactly. Every other one of these
/// samples is raised by one count (22.35 nV, a ninth of the chip's rms noise at 512 Hz) on each
/// channel that is neither 0 nor at a rail. All other samples stay as they are.
#[derive(Debug)]
pub(super) struct Dither {
    /// Previous sample as delivered. It starts as `i32::MIN`, which no 24-bit count reaches, so
    /// that the first sample never counts as a repetition.
    last: [i32; CHANNELS],
}

impl Dither {
    pub(super) fn new() -> Self {
        const { assert!(CHANNELS.is_multiple_of(CONVERTER_CHANNELS)) };
        Self { last: [i32::MIN; CHANNELS] }
    }

    /// Adds one count to the channels of every chip that would repeat its previous counts.
    pub(super) fn apply(&mut self, counts: &mut [i32; CHANNELS]) {
        let new = counts.chunks_exact_mut(CONVERTER_CHANNELS);
        for (new, last) in new.zip(self.last.chunks_exact(CONVERTER_CHANNELS)) {
            if new != last {
                continue;
            }
            for count in new.iter_mut().filter(|count| is_live(**count)) {
                *count += 1;
            }
        }
        self.last = *counts;
    }
}

/// Returns whether a count is neither at a rail nor 0, the count of channels without an electrode.
fn is_live(count: i32) -> bool {
    let value = f64::from(count);
    count != 0 && value > *RAILS.start() && value < *RAILS.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converts one channel with a term for each weight: `values` times the weight. Returns the
    /// channel's counts, and the number of saturated samples.
    fn converted(values: &[f64], weights: &[f64], lsb_uv: f64) -> (Vec<i32>, u64) {
        let (mut counts, mut saturated) = (Vec::new(), 0);
        let mut block = CountBlock::new();
        let mut rest = values;
        while !rest.is_empty() {
            let length = block.start(rest.len());
            let terms = weights.iter().map(|weight| (&rest[..length], *weight));
            block.convert(3, terms, lsb_uv);
            while !block.is_empty() {
                let (sample, beyond) = block.next();
                counts.push(sample[3]);
                saturated += beyond;
            }
            rest = &rest[length..];
        }
        (counts, saturated)
    }

    #[test]
    fn values_round_and_saturate_as_one_by_one() {
        let ends = [RAILS.start(), RAILS.end(), &0.0, &1.0, &-2.0, &1e5];
        let values: Vec<f64> = ends
            .iter()
            .flat_map(|end| [-1.0, -0.5, 0.0, 0.5, 1.0].map(|offset| **end + offset))
            .flat_map(|value| [value.next_down(), value, value.next_up()])
            .chain([1e100, -1e100, -0.0])
            .chain((0..1_000).map(|k| f64::from(k * 7_919 % 20_011) / 7.0 - 1_000.0))
            .collect();
        for (weights, lsb_uv) in [(&[1.0][..], 1.0), (&[0.3, 0.5, 0.2], 0.022_35), (&[], 1.0)] {
            let unlimited = values.iter().map(|value| {
                let terms = weights.iter().map(|weight| value * weight);
                (terms.sum::<f64>() / lsb_uv).round()
            });
            let beyond = unlimited.clone().filter(|value| !RAILS.contains(value));
            let saturated = u64::try_from(beyond.count()).expect("few values");
            #[expect(clippy::cast_possible_truncation, reason = "whole and within i24")]
            let counts =
                unlimited.map(|value| value.clamp(*RAILS.start(), *RAILS.end()) as i32).collect();
            assert_eq!(converted(&values, weights, lsb_uv), (counts, saturated));
        }
    }

    fn sample(first: [i32; CONVERTER_CHANNELS]) -> [i32; CHANNELS] {
        let mut counts = [0; CHANNELS];
        counts[..CONVERTER_CHANNELS].copy_from_slice(&first);
        counts
    }

    fn dithered(samples: &[[i32; CHANNELS]]) -> Vec<[i32; CHANNELS]> {
        let mut dither = Dither::new();
        let mut samples = samples.to_vec();
        for counts in &mut samples {
            dither.apply(counts);
        }
        samples
    }

    #[test]
    fn a_converter_never_repeats_and_is_off_by_at_most_one_count() {
        let flat = sample([5, -1, 8_388_607, -8_388_608, 0, 8_388_606, 100, -100]);
        let other = sample([6, 0, 8_388_607, -8_388_608, 0, 8_388_607, 101, -99]);
        let given = [flat, flat, other, other, flat, flat, flat];
        let delivered = dithered(&given);
        for pair in delivered.windows(2) {
            assert_ne!(pair[0][..8], pair[1][..8]);
        }
        for (given, delivered) in given.iter().zip(&delivered) {
            for (given, delivered) in given.iter().zip(delivered) {
                let added = delivered - given;
                assert!(added == 0 || (added == 1 && is_live(*given)), "{given}");
            }
        }
    }

    #[test]
    fn one_channel_that_changes_is_enough_to_leave_its_converter_as_it_is() {
        let samples: Vec<_> = (0..100).map(|k| sample([7, 7, 7, 7, 7, 7, 7, k % 2])).collect();
        assert_eq!(dithered(&samples), samples);
    }
}
