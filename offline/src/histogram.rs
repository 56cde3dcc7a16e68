//! Histogram of the levels of codes.

use std::ops::RangeInclusive;

/// Number of bins.
pub const BINS: usize = BIN_COUNT as usize;
const BIN_COUNT: u8 = 64;

/// How often the values of codes lie in each part of their format's range.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelHistogram {
    /// Levels that the format can hold.
    pub range: RangeInclusive<i32>,
    /// Number of values in each of [`BINS`] equal parts of the range.
    pub bins: [u64; BINS],
    /// Number of values at either end of the range.
    pub at_ends: u64,
}

impl LevelHistogram {
    /// Creates an empty histogram.
    pub(crate) fn new(range: RangeInclusive<i32>) -> Self {
        Self {
            range,
            bins: [0; BINS],
            at_ends: 0,
        }
    }

    /// Counts the values of a code.
    pub(crate) fn add(&mut self, levels: &[i32]) {
        let (least, greatest) = (i64::from(*self.range.start()), i64::from(*self.range.end()));
        for level in levels.iter().map(|level| i64::from(*level)) {
            let level = level.clamp(least, greatest);
            let bin = (level - least) * i64::from(BIN_COUNT) / (greatest - least + 1);
            let bin = usize::try_from(bin).unwrap_or(0);
            self.bins[bin] += 1;
            self.at_ends += u64::from(level == least || level == greatest);
        }
    }

    /// Returns the number of values.
    pub fn values(&self) -> u64 {
        self.bins.iter().sum()
    }
}
