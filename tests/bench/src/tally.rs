//! Instruction counts of repeated measurements, and their text form in an image's output.

use core::fmt;

/// Smallest, largest and total instruction count of the measurements with one input.
#[derive(Clone, Copy, PartialEq, Eq)]
#[cfg_attr(not(target_os = "none"), derive(serde::Deserialize))]
pub struct Tally {
    /// Smallest instruction count of a measurement.
    pub fewest: u32,
    /// Largest instruction count of a measurement.
    pub most: u32,
    /// Sum of the instruction counts of all measurements.
    pub total: u64,
}

impl Tally {
    /// Tally before the first measurement.
    pub const EMPTY: Self = Self {
        fewest: u32::MAX,
        most: 0,
        total: 0,
    };

    /// Includes one more measurement, of this many instructions.
    pub fn add(&mut self, instructions: u32) {
        self.fewest = self.fewest.min(instructions);
        self.most = self.most.max(instructions);
        self.total += u64::from(instructions);
    }
}

impl fmt::Debug for Tally {
    /// Writes `[FEWEST, MOST, TOTAL]`, from which the report reads the tally.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "[{}, {}, {}]",
            self.fewest, self.most, self.total
        )
    }
}
