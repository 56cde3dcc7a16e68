//! Instruction counts of repeated runs, and their text form in an image's output.

use core::{fmt, num::ParseIntError, str::FromStr};

/// Smallest, largest and total instruction count of the runs on one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tally {
    /// Instructions of the shortest run.
    pub fewest: u32,
    /// Instructions of the longest run.
    pub most: u32,
    /// Instructions of all runs together.
    pub total: u64,
}

impl Tally {
    /// Tally before the first run.
    pub const EMPTY: Self = Self {
        fewest: u32::MAX,
        most: 0,
        total: 0,
    };

    /// Includes one more run of this many instructions.
    pub fn add(&mut self, instructions: u32) {
        self.fewest = self.fewest.min(instructions);
        self.most = self.most.max(instructions);
        self.total += u64::from(instructions);
    }
}

impl FromStr for Tally {
    type Err = ParseIntError;

    /// Parses `FEWEST MOST TOTAL`, which `Display` writes.
    fn from_str(text: &str) -> Result<Self, ParseIntError> {
        let mut numbers = text.splitn(3, ' ');
        let mut next = || numbers.next().unwrap_or_default();
        Ok(Self {
            fewest: next().parse()?,
            most: next().parse()?,
            total: next().parse()?,
        })
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} {} {}", self.fewest, self.most, self.total)
    }
}
