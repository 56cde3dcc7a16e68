//! Instructions of one contender over the blocks of one input, and the line that says so.

use core::fmt;

/// Fewest and most instructions of a block, and those of all blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tally {
    /// Fewest instructions of a block.
    pub fewest: u32,
    /// Most instructions of a block.
    pub most: u32,
    /// Instructions of all blocks.
    pub total: u64,
}

impl Tally {
    /// Nothing counted yet.
    pub const EMPTY: Self = Self {
        fewest: u32::MAX,
        most: 0,
        total: 0,
    };

    /// Takes in one block.
    pub fn add(&mut self, instructions: u32) {
        self.fewest = self.fewest.min(instructions);
        self.most = self.most.max(instructions);
        self.total += u64::from(instructions);
    }

    /// Reads what [`Tally`]'s `Display` wrote.
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
