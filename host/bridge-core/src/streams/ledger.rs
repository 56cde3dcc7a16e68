//! Exact counts of the items that were made, received and lost, derived from their sequence
//! numbers.

/// Counts numbered items, such as codes. The number of made items is always the sum of received and
/// lost items, also when the sequence numbers wrap.
///
/// The counts depend only on the sequence numbers, not on times or rates. A gap of up to 2^31 - 1
/// numbers is a loss; a number below the next expected number, modulo 2^32, is a replay.
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
    /// The item has the expected number or a later number.
    New {
        /// Number of items that are missing directly before this item; usually 0.
        lost: u32,
    },
    /// The item's number is below the next expected number: the item is a duplicate, or the sender
    /// restarted.
    Old,
}

impl Ledger {
    /// Sets the next expected number, without counting a loss or a replay. All counts are kept.
    pub fn expect_next(&mut self, number: u32) {
        self.expected = Some(number);
    }

    /// Accepts any number for the next item, without counting a loss or a replay.
    pub fn expect_any(&mut self) {
        self.expected = None;
    }

    /// Returns whether `number` is below the next expected number, modulo 2^32.
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

    /// Counts every item before number `next` that has not arrived as lost, and returns how many
    /// there are. `next` is the number of the sender's next item, as the sender reports it.
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

    /// Number of items that the sender has made, derived from their numbers: received plus lost.
    pub fn made(&self) -> u64 {
        self.received + self.lost
    }

    /// Number of items that arrived; replays do not count.
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Number of items that never arrived.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Number of bursts; a burst is a sequence of consecutive lost items.
    pub fn bursts(&self) -> u64 {
        self.bursts
    }

    /// Number of items in the longest burst.
    pub fn longest_burst(&self) -> u32 {
        self.longest_burst
    }

    /// Number of arrivals with a number below the expected number.
    pub fn replays(&self) -> u64 {
        self.replays
    }
}
