//! Lost codes must be counted exactly, replaced by fillers and flagged.

use bridge_core::{FillerPolicy, Settings};
use link::{Encoder, Streams};
use proptest::prelude::*;

use crate::board::Board;
use crate::recorder::{Harness, SETTINGS, assert_evenly_spaced};

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn every_lost_code_has_one_filler_in_its_place(
        losses in prop::collection::vec(prop::bool::weighted(0.3), 1..200),
    ) {
        let board = Board {
            encoder: Encoder::starting_at(u32::MAX - 30),
            ..Board::new()
        };
        let mut harness = Harness::streaming(SETTINGS, board);
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
        assert_evenly_spaced(&harness.recorder.encoded);
        // Every frame, even a filler, has the window index, the device time and the losses so far.
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
fn an_outage_too_long_to_fill_is_counted_completely() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.board.next_window = 70_001;
    harness.code(2, false);
    let summary = harness.core.summary();
    assert_eq!((summary.lost, summary.fillers), (70_000, 65_536));
    assert_eq!((summary.bursts, summary.longest_burst), (1, 70_000));
    assert_eq!(harness.figure("loss", "lost and not filled"), "4464");
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
        let encoded = harness.recorder.encoded.iter();
        let values: Vec<f32> = encoded.map(|frame| frame.eeg.data[127]).collect();
        assert_eq!(values, expected, "{filler:?}");
        assert_eq!(harness.core.summary().lost, 2);
        // The decoder gets a placeholder for every lost code too, because it must average only
        // consecutive windows.
        let windows = harness.recorder.windows.iter();
        let known: Vec<bool> = windows.map(|window| window.z.is_some()).collect();
        assert_eq!(known, [true, false, false, true]);
    }
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
    assert_eq!((summary.wire.resyncs, summary.received), (1, 2));
    assert_eq!(summary.wire.crc + summary.wire.cobs, 1);
    let counted = summary.to_string().contains("made 3 received 2 lost 1");
    assert!(counted, "{summary}");
    let figures = ["CRC errors", "COBS errors"].map(|name| harness.figure("link", name));
    let crc_first = [summary.wire.crc, summary.wire.cobs].map(|count| count.to_string());
    assert_eq!(figures, crc_first);
    assert_eq!(harness.figure("link", "resyncs"), "1");
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
fn fillers_are_timed_by_reports_also_before_the_first_code() {
    for codes in [0, 1] {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        harness.codes(codes, 1);
        for _ in 0..2 {
            harness.lose(3);
            harness.stats(Streams::CODES);
        }
        harness.code(1, false);
        let fillers = harness.fillers();
        assert_eq!(fillers.iter().filter(|filler| **filler).count(), 6);
        assert_evenly_spaced(&harness.recorder.encoded);
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
    assert_evenly_spaced(&harness.recorder.encoded);
}
