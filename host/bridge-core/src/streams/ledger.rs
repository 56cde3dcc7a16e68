//! Counts of the received, lost and filled data of a stream.

/// Counts numbered items, such as codes, as received or lost. The two counts always add up to the
/// number of items that the sender made, even when the sequence numbers wrap.
///
/// The counts depend only on the sequence numbers, not on times or rates. A gap of up to 2^31 - 1
/// numbers is a loss; a number below the next expected number, modulo 2^32, is a replay.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Ledger {
    expected: Option<u32>,
    /// Number of items that arrived; replays do not count.
    pub(crate) received: u64,
    /// Number of items that never arrived.
    pub(crate) lost: u64,
    /// Number of bursts. A burst is a run of consecutive lost items.
    pub(crate) bursts: u64,
    /// Number of items in the longest burst.
    pub(crate) longest_burst: u32,
    /// Number of items that arrived with a number below the next expected number.
    pub(crate) replays: u64,
}

/// Result of recording the number of an item that arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arrival {
    /// The item's number is the expected number or a later one.
    New {
        /// Number of items that are missing directly before this item; mostly 0.
        lost: u32,
    },
    /// The item's number is below the expected one: it was sent twice, or the sender restarted.
    Old,
}

impl Ledger {
    /// Sets the next expected number, without counting a loss or a replay. All counts are kept.
    pub(crate) fn expect_next(&mut self, number: u32) {
        self.expected = Some(number);
    }

    /// Accepts any number for the next item, and counts neither a loss nor a replay for it.
    pub(crate) fn expect_any(&mut self) {
        self.expected = None;
    }

    /// Returns the next expected number; 0 if any number is accepted.
    pub(crate) fn next_number(&self) -> u32 {
        self.expected.unwrap_or(0)
    }

    /// Returns whether `number` is below the next expected number, modulo 2^32.
    pub(crate) fn is_old(&self, number: u32) -> bool {
        self.missing_before(number) >= 1 << 31
    }

    fn missing_before(&self, number: u32) -> u32 {
        number.wrapping_sub(self.expected.unwrap_or(number))
    }

    /// Records the arrival of item `number`. An old number counts as a replay, not as received.
    pub(crate) fn record(&mut self, number: u32) -> Arrival {
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

    /// Counts as lost all items before number `next` that have not arrived, and returns how many
    /// they are. `next` is the number of the sender's next item, as the sender reports it.
    pub(crate) fn count_lost_before(&mut self, next: u32) -> u32 {
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

    /// Returns the number of items that the sender has made: those received plus those lost.
    pub(crate) fn made(&self) -> u64 {
        self.received + self.lost
    }
}

/// Numbers of received and missing items of a stream with one item per hop.
#[derive(Clone, Debug, Default)]
pub(crate) struct HopCounts {
    pub(crate) ledger: Ledger,
    /// Number of items that are missing because restarts interrupted the stream.
    pub(crate) between_runs: u64,
    pub(crate) fillers: u64,
    /// Number of missing items without a filler, because the gap was longer than what fits into the
    /// queues of subscribers.
    pub(crate) unfilled: u64,
}

impl HopCounts {
    /// Returns the number of missing items: those lost in a run, plus those between two runs.
    pub(crate) fn missing(&self) -> u64 {
        self.ledger.lost + self.between_runs
    }
}

/// Numbers of codes that could not be used, and of values that were clipped.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CodeCounts {
    /// Number of codes whose model or format is not the one that the device reported.
    pub(crate) foreign: u64,
    /// Number of cells of the encoder's input that the device clipped to int8. A cell counts once
    /// for each window that contains it.
    pub(crate) clipped: u64,
    /// Number of code values that the device clipped to the range of the code's format.
    pub(crate) clipped_values: u64,
}

/// Counts of packed blocks by kind, of their bits, and of clipped values.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PackedCounts {
    /// Number of bits in all blocks, without the overhead of the frames around them.
    pub(crate) bits: u64,
    /// Number of blocks that the device coded without prediction from the block before.
    pub(crate) resets: u64,
    /// Number of blocks with the flag `MISFIT`: the model does not represent their signals well.
    /// Blocks before the filters have settled do not count, because the model fits none of them.
    pub(crate) misfits: u64,
    /// Number of blocks with the flag `BLANK`: they were too long and have no content. Blocks
    /// before the filters have settled do not count.
    pub(crate) blanks: u64,
    /// Number of blocks that the device quantised more coarsely than the set rate, because they
    /// would have been too long.
    pub(crate) coarser: u64,
    /// Number of electrode values that the device clipped to the range of the encoder's input.
    pub(crate) clipped: u64,
}

/// Numbers of received, lost and unpublished ADC samples or filtered steps of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SampleCounts {
    pub(crate) received: u64,
    pub(crate) lost: u64,
    /// Number of samples that are missing because restarts interrupted the stream.
    pub(crate) between_runs: u64,
    /// Number of samples that no published frame contains: samples of a frame that was unfinished
    /// when the stream ended, samples by which a gap exceeds two minutes, and, if the user wants no
    /// fillers, all samples of a frame with a lost sample.
    pub(crate) unpublished: u64,
    /// Number of messages whose content does not match the device's capabilities.
    pub(crate) malformed: u64,
    /// Value of `missing` at the last report to `/diagnostics`; the next report subtracts it.
    pub(crate) reported: u64,
}

impl SampleCounts {
    /// Returns the number of missing samples: those lost in a run, plus those between two runs.
    pub(crate) fn missing(&self) -> u64 {
        self.lost.saturating_add(self.between_runs)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{Arrival, Ledger};

    proptest! {
        #[test]
        fn losses_are_counted_exactly_over_any_wrap(
            first in prop_oneof![any::<u32>(), Just(u32::MAX - 50)],
            runs in prop::collection::vec((0u32..40, prop_oneof![0u32..4, 1u32..4097]), 1..60),
        ) {
            let mut ledger = Ledger::default();
            ledger.expect_next(first);
            let mut number = first;
            let (mut received, mut lost, mut bursts, mut longest) = (0u64, 0u64, 0u64, 0u32);
            let mut pending = 0;
            for (arrive, vanish) in runs {
                for _ in 0..arrive {
                    prop_assert_eq!(ledger.record(number), Arrival::New { lost: pending });
                    number = number.wrapping_add(1);
                    received += 1;
                    bursts += u64::from(pending > 0);
                    longest = longest.max(pending);
                    pending = 0;
                }
                number = number.wrapping_add(vanish);
                pending += vanish;
                lost += u64::from(vanish);
            }
            prop_assert_eq!(ledger.count_lost_before(number), pending);
            bursts += u64::from(pending > 0);
            longest = longest.max(pending);
            prop_assert_eq!((ledger.received, ledger.lost), (received, lost));
            prop_assert_eq!(ledger.made(), u64::from(number.wrapping_sub(first)));
            prop_assert_eq!((ledger.bursts, ledger.longest_burst), (bursts, longest));
            prop_assert_eq!(ledger.replays, 0);
        }

        #[test]
        fn a_replay_is_neither_received_nor_lost(first in any::<u32>(), back in 1u32..1000) {
            let mut ledger = Ledger::default();
            ledger.expect_next(first);
            for offset in 0..1000 {
                ledger.record(first.wrapping_add(offset));
            }
            let before = ledger.clone();
            prop_assert_eq!(ledger.record(first.wrapping_add(1000 - back)), Arrival::Old);
            prop_assert_eq!(ledger.made(), before.made());
            prop_assert_eq!(ledger.replays, 1);
            prop_assert_eq!(ledger.record(first.wrapping_add(1000)), Arrival::New { lost: 0 });
        }
    }

    #[test]
    fn a_new_ledger_accepts_any_first_number() {
        let mut ledger = Ledger::default();
        assert_eq!(ledger.record(77), Arrival::New { lost: 0 });
        assert_eq!(ledger.count_lost_before(80), 2);
        assert_eq!((ledger.made(), ledger.lost), (3, 2));
        // A report whose next number has already been received changes nothing.
        assert_eq!(ledger.count_lost_before(5), 0);
        assert_eq!(ledger.record(80), Arrival::New { lost: 0 });
    }
}
