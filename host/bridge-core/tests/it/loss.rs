//! Lost codes are counted exactly, filled and flagged.

use bridge_core::{Arrival, FillerPolicy, Ledger, Settings};
use link::Streams;
use proptest::prelude::*;

use crate::board::{Board, assert_has};
use crate::recorder::{Harness, SETTINGS, stamps};

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn every_lost_code_has_one_filler_in_its_place(
        losses in prop::collection::vec(prop::bool::weighted(0.3), 1..200),
    ) {
        let mut harness = Harness::streaming(SETTINGS, Board::starting_at(u32::MAX - 30, 0));
        for lost in &losses {
            harness.code(3, *lost);
        }
        harness.stats(Streams::CODES);
        prop_assert_eq!(harness.fillers(), losses.clone());
        let summary = harness.core.summary();
        let lost = losses.iter().filter(|lost| **lost).count() as u64;
        prop_assert_eq!((summary.made, summary.lost), (losses.len() as u64, lost));
        prop_assert_eq!(summary.received + summary.lost, summary.made);
        prop_assert_eq!((summary.fillers, summary.frames_lost), (lost, lost));
        // Every frame, fillers included, carries its window index, its device time and the number
        // of codes lost so far.
        for (frame, index) in harness.recorder.encoded.iter().zip(0..) {
            prop_assert_eq!(frame.tri.data[1], index);
            let device_us = 1_000_000 + 62_500 * (i64::from(index) + 1);
            let word = |place: usize| i64::from(frame.tri.data[place]);
            prop_assert_eq!(word(3) | word(4) << 16 | word(5) << 32, device_us);
            let until = usize::try_from(index).unwrap() + 1;
            let lost = losses[..until].iter().filter(|lost| **lost).count();
            prop_assert_eq!(word(6), i64::try_from(lost).unwrap());
        }
    }
}

#[test]
fn bursts_of_up_to_4096_codes_are_filled() {
    for burst in [1, 2, 4095, 4096] {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        harness.code(1, false);
        harness.lose(burst);
        harness.code(2, false);
        let summary = harness.core.summary();
        assert_eq!((summary.lost, summary.fillers), (burst, burst));
        assert_eq!(
            (summary.bursts, u64::from(summary.longest_burst)),
            (1, burst)
        );
        assert_eq!(harness.recorder.encoded.len() as u64, burst + 2);
    }
}

#[test]
fn an_outage_too_long_to_fill_is_counted_completely() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.board.next_window = 70_001;
    harness.code(2, false);
    let summary = harness.core.summary();
    assert_eq!((summary.lost, summary.fillers), (70_000, 65_536));
    let report = format!(
        "{:?}",
        harness.core.diagnostics(crate::board::at(harness.now_us))
    );
    let unfilled = r#"key: "lost and not filled", value: "4464""#;
    assert_has(&report, [unfilled]);
}

#[test]
fn fillers_repeat_the_last_code_are_zeros_or_are_not_published() {
    for (filler, expected) in [
        (FillerPolicy::Last, vec![2.0, 2.0, 2.0, 4.5]),
        (FillerPolicy::Zeros, vec![2.0, 0.0, 0.0, 4.5]),
        (FillerPolicy::Off, vec![2.0, 4.5]),
    ] {
        let mut harness = Harness::streaming(Settings { filler, ..SETTINGS }, Board::new());
        harness.code(5, false);
        harness.code(6, true);
        harness.code(7, true);
        harness.code(10, false);
        let values: Vec<f32> = harness
            .recorder
            .encoded
            .iter()
            .map(|frame| frame.eeg.data[127])
            .collect();
        assert_eq!(values, expected, "{filler:?}");
        assert_eq!(harness.core.summary().lost, 2);
        // The decoder also gets a placeholder for every lost code, because it must average only
        // windows of consecutive codes.
        let known: Vec<bool> = harness
            .recorder
            .windows
            .iter()
            .map(|window| window.z.is_some())
            .collect();
        assert_eq!(known, [true, false, false, true]);
    }
}

#[test]
fn fillers_have_the_stamps_of_the_lost_codes() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    for index in 0..40 {
        harness.code(0, index % 3 == 1);
    }
    let stamps = stamps(&harness.recorder.encoded);
    for pair in stamps.windows(2) {
        assert_eq!(pair[1] - pair[0], 62_500_000);
    }
}

#[test]
fn a_frame_that_arrives_twice_is_published_once() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.now_us += 62_500;
    let bytes = harness.board.code(2_000_000, 1);
    harness.receive(&bytes);
    harness.receive(&bytes);
    assert_eq!(harness.recorder.encoded.len(), 1);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (1, 0));
}

#[test]
fn a_damaged_byte_costs_one_frame_and_is_counted() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.now_us += 62_500;
    let mut bytes = harness.board.code(3_000_000, 1);
    bytes[40] ^= 4;
    harness.receive(&bytes);
    harness.code(1, false);
    assert_eq!(harness.fillers(), [false, true, false]);
    let summary = harness.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.wire.resyncs),
        (2, 1, 1)
    );
    assert_eq!(summary.wire.crc + summary.wire.cobs, 1);
    assert!(
        summary.to_string().contains("made 3 received 2 lost 1"),
        "{summary}"
    );
}

#[test]
fn dropped_frames_without_a_code_are_no_lost_codes() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.board.skip_frame();
    harness.code(1, false);
    let summary = harness.core.summary();
    assert_eq!((summary.lost, summary.frames_lost), (0, 1));
}

#[test]
fn fillers_of_two_successive_reports_have_successive_times() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    for _ in 0..2 {
        harness.lose(3);
        harness.stats(Streams::CODES);
    }
    harness.code(1, false);
    let times: Vec<i32> = harness
        .recorder
        .encoded
        .iter()
        .map(|f| f.tri.data[3])
        .collect();
    assert_eq!(times.len(), 8);
    for pair in times.windows(2) {
        assert_eq!((pair[1] - pair[0]).rem_euclid(65_536), 62_500);
    }
}

#[test]
fn fillers_before_the_first_code_are_timed_by_the_report() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.lose(5);
    harness.stats(Streams::CODES);
    harness.code(1, false);
    assert_eq!(harness.fillers(), [true, true, true, true, true, false]);
    let stamps = stamps(&harness.recorder.encoded);
    for pair in stamps.windows(2) {
        assert_eq!(pair[1] - pair[0], 62_500_000);
    }
}

#[test]
fn a_wrong_device_time_moves_no_stamp() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    for index in 0..40 {
        if index == 20 {
            harness.now_us += 62_500;
            let bytes = harness.board.code(u64::MAX - 5, 1);
            harness.receive(&bytes);
        } else {
            harness.code(1, false);
        }
    }
    for pair in harness.recorder.encoded.windows(2) {
        let stamp = |at: usize| pair[at].header.stamp.nanoseconds();
        assert_eq!(stamp(1) - stamp(0), 62_500_000);
    }
}

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
