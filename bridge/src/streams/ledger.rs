//! Exact account of what was made, received and lost.

/// Exact account of something numbered: made = received + lost, always, over any wrap.
///
/// Counts by the numbers alone, so it needs no clock and no assumption about rates. A gap of up
/// to 2^31 - 1 is a loss; a number that lies behind is a replay.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ledger {
    expected: Option<u32>,
    received: u64,
    lost: u64,
    bursts: u64,
    longest_burst: u32,
    replays: u64,
}

/// What a number says about those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// In its turn, after this many lost ones (usually 0).
    New {
        /// Numbers that are missing right before it.
        lost: u32,
    },
    /// Behind what came already: a duplicate, or a sender that began anew.
    Old,
}

impl Ledger {
    /// Expect `number` next; what came before stays counted.
    pub fn expect_next(&mut self, number: u32) {
        self.expected = Some(number);
    }

    /// Take any number as the next one.
    pub fn expect_any(&mut self) {
        self.expected = None;
    }

    /// Whether this number lies behind what came already.
    pub fn is_old(&self, number: u32) -> bool {
        self.missing_before(number) >= 1 << 31
    }

    fn missing_before(&self, number: u32) -> u32 {
        number.wrapping_sub(self.expected.unwrap_or(number))
    }

    /// A numbered thing arrived. One that lies behind is counted as a replay, not as received.
    pub fn record(&mut self, number: u32) -> Arrival {
        if self.is_old(number) {
            self.replays += 1;
            return Arrival::Old;
        }
        let lost = self.missing_before(number);
        self.expected = Some(number.wrapping_add(1));
        self.received += 1;
        self.add_lost(lost);
        Arrival::New { lost }
    }

    /// The sender says that `next` will be its next number: everything before it that has not
    /// arrived is lost. Returns how many that are.
    pub fn count_lost_before(&mut self, next: u32) -> u32 {
        if self.is_old(next) {
            return 0;
        }
        let lost = self.missing_before(next);
        self.expected = Some(next);
        self.add_lost(lost);
        lost
    }

    fn add_lost(&mut self, lost: u32) {
        self.lost += u64::from(lost);
        self.bursts += u64::from(lost > 0);
        self.longest_burst = self.longest_burst.max(lost);
    }

    /// Made by the sender, as far as its numbers tell.
    pub fn made(&self) -> u64 {
        self.received + self.lost
    }

    /// Arrived, each number once.
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Never arrived.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Runs of lost numbers.
    pub fn bursts(&self) -> u64 {
        self.bursts
    }

    /// Length of the longest run of lost numbers.
    pub fn longest_burst(&self) -> u32 {
        self.longest_burst
    }

    /// Arrived behind others.
    pub fn replays(&self) -> u64 {
        self.replays
    }
}
