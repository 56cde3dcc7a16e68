//! Exact counts of items that were made, received and lost, from their sequence numbers.

/// Counts numbered items, such as codes. Always made = received + lost, also when the numbers wrap.
///
/// The counts depend on the numbers alone, not on time or rates. A gap of up to 2^31 - 1 numbers is
/// a loss; a number below the next expected one, modulo 2^32, is a replay.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ledger {
    expected: Option<u32>,
    received: u64,
    lost: u64,
    bursts: u64,
    longest_burst: u32,
    replays: u64,
}

/// Result of recording the number of an item that arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// A number that was not received before.
    New {
        /// Number of items that are missing directly before this one; usually 0.
        lost: u32,
    },
    /// A number below the next expected one: the item is a duplicate, or its sender restarted.
    Old,
}

impl Ledger {
    /// Makes `number` the next expected one, without counting a loss or a replay. All counts stay.
    pub fn expect_next(&mut self, number: u32) {
        self.expected = Some(number);
    }

    /// Makes the next number that arrives the expected one, whatever it is.
    pub fn expect_any(&mut self) {
        self.expected = None;
    }

    /// Returns whether `number` is below the next expected one, modulo 2^32.
    pub fn is_old(&self, number: u32) -> bool {
        self.missing_before(number) >= 1 << 31
    }

    fn missing_before(&self, number: u32) -> u32 {
        number.wrapping_sub(self.expected.unwrap_or(number))
    }

    /// Records the arrival of item `number`. An old number is counted as a replay, not as received.
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

    /// Counts every item before `next` that has not arrived as lost, and returns their number.
    /// `next` is the number that the sender reports for its next item.
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

    /// Number of items that the sender has made, as far as its numbers show: received + lost.
    pub fn made(&self) -> u64 {
        self.received + self.lost
    }

    /// Number of items that arrived, without replays.
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Number of items that never arrived.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Number of runs of consecutive lost items.
    pub fn bursts(&self) -> u64 {
        self.bursts
    }

    /// Length of the longest run of consecutive lost items.
    pub fn longest_burst(&self) -> u32 {
        self.longest_burst
    }

    /// Number of arrivals whose number was below the expected one.
    pub fn replays(&self) -> u64 {
        self.replays
    }
}
