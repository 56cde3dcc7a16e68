//! Statistics of repeated instruction counts, and their text form in an image's output.

use core::fmt;

/// Fewest, most and total instructions of repeated measurements with one input.
#[derive(Clone, Copy, PartialEq, Eq)]
#[cfg_attr(not(target_os = "none"), derive(serde::Deserialize))]
pub struct Tally {
    /// Smallest instruction count of any measurement.
    pub fewest: u32,
    /// Largest instruction count of any measurement.
    pub most: u32,
    /// Sum of the instruction counts of all measurements.
    pub total: u64,
}

impl Tally {
    /// The tally that includes no measurement.
    pub const EMPTY: Self = Self { fewest: u32::MAX, most: 0, total: 0 };

    /// Adds a measurement of this many instructions.
    pub fn add(&mut self, instructions: u32) {
        self.fewest = self.fewest.min(instructions);
        self.most = self.most.max(instructions);
        self.total += u64::from(instructions);
    }
}

impl fmt::Debug for Tally {
    /// Writes `[FEWEST, MOST, TOTAL]`, which the report on the PC parses.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "[{}, {}, {}]", self.fewest, self.most, self.total)
    }
}
