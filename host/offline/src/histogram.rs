//! Histogram of the integer values (levels) in codes.

use std::ops::RangeInclusive;

/// Number of bins of a [`LevelHistogram`].
pub const BINS: usize = BIN_COUNT as usize;
const BIN_COUNT: u8 = 64;
/// Initial [`LevelHistogram::span`], levels: the bins first cover the range of an 8-bit code.
const SMALLEST_SPAN: i32 = 128;

/// Histogram of the values in codes. Its range grows until it contains all values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelHistogram {
    /// The bins divide `-span..span` equally; `span` is 128 levels, doubled until all values are
    /// inside.
    pub span: i32,
    /// Number of values in each bin.
    pub bins: [u64; BINS],
    /// Number of values equal to the smallest or the largest level of the codes' format.
    pub at_ends: u64,
    /// Levels that the format can hold.
    range: RangeInclusive<i32>,
}

impl LevelHistogram {
    /// Creates an empty histogram of codes whose format can hold the levels in `range`.
    pub(crate) fn new(range: RangeInclusive<i32>) -> Self {
        Self { span: SMALLEST_SPAN, bins: [0; BINS], at_ends: 0, range }
    }

    pub(crate) fn add(&mut self, levels: &[i32]) {
        let (least, greatest) = (*self.range.start(), *self.range.end());
        for level in levels {
            let level = (*level).clamp(least, greatest);
            while !(-self.span..self.span).contains(&level) {
                self.double();
            }
            let width = 2 * self.span / i32::from(BIN_COUNT);
            let bin = usize::try_from((level + self.span) / width).unwrap_or(0);
            self.bins[bin] += 1;
            self.at_ends += u64::from(level == least || level == greatest);
        }
    }

    /// Doubles the span: merges pairs of neighbouring bins into the bins of the inner half.
    fn double(&mut self) {
        let mut bins = [0; BINS];
        for (bin, count) in self.bins.iter().enumerate() {
            bins[BINS / 4 + bin / 2] += count;
        }
        self.bins = bins;
        self.span *= 2;
    }

    /// Returns the number of values counted so far.
    pub fn values(&self) -> u64 {
        self.bins.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bits_keep_their_range_and_the_ends_are_counted() {
        let mut histogram = LevelHistogram::new(-128..=127);
        histogram.add(&[-128, -1, 0, 3, 127]);
        assert_eq!(histogram.span, 128);
        assert_eq!([0, 31, 32, 63].map(|bin| histogram.bins[bin]), [1, 1, 2, 1]);
        assert_eq!((histogram.values(), histogram.at_ends), (5, 2));
    }

    #[test]
    fn the_span_follows_the_largest_value_and_no_value_is_lost() {
        let mut histogram = LevelHistogram::new(-32_768..=32_767);
        histogram.add(&[-5, 5, 127]);
        histogram.add(&[-300]);
        // Each bin now covers 16 levels.
        assert_eq!(histogram.span, 512);
        assert_eq!([31, 32, 39, 13].map(|bin| histogram.bins[bin]), [1, 1, 1, 1]);
        assert_eq!((histogram.values(), histogram.at_ends), (4, 0));
    }
}
