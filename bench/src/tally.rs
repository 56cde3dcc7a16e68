//! Instruction counts of repeated measurements, and their text form in an image's output.

use core::fmt;

/// Smallest, largest and total instruction count of the measurements with one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

    /// Parses `FEWEST MOST TOTAL`, which `Display` writes.
    pub fn parse(text: &str) -> Option<Self> {
        let mut numbers = text.split(' ');
        let tally = Self {
            fewest: numbers.next()?.parse().ok()?,
            most: numbers.next()?.parse().ok()?,
            total: numbers.next()?.parse().ok()?,
        };
        numbers.next().is_none().then_some(tally)
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} {} {}", self.fewest, self.most, self.total)
    }
}
