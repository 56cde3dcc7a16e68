//! Tests of `Ledger`: the number of made items is always that of received plus lost items.

use bridge_core::{Arrival, Ledger};
use proptest::prelude::*;

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
        prop_assert_eq!((ledger.received(), ledger.lost()), (received, lost));
        prop_assert_eq!(ledger.made(), u64::from(number.wrapping_sub(first)));
        prop_assert_eq!((ledger.bursts(), ledger.longest_burst()), (bursts, longest));
        prop_assert_eq!(ledger.replays(), 0);
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
        prop_assert_eq!(ledger.replays(), 1);
        prop_assert_eq!(ledger.record(first.wrapping_add(1000)), Arrival::New { lost: 0 });
    }
}

#[test]
fn a_new_ledger_accepts_any_first_number() {
    let mut ledger = Ledger::default();
    assert_eq!(ledger.record(77), Arrival::New { lost: 0 });
    assert_eq!(ledger.count_lost_before(80), 2);
    assert_eq!((ledger.made(), ledger.lost()), (3, 2));
    // A reported next number that is below the numbers already received changes nothing.
    assert_eq!(ledger.count_lost_before(5), 0);
    assert_eq!(ledger.record(80), Arrival::New { lost: 0 });
}
