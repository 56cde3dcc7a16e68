//! Devices that stop sending, and devices that refuse commands.

use std::time::Duration;

use link::{AckResult, ToDevice, ToHost};

use crate::board::{Board, assert_has, at};
use crate::recorder::{Harness, SETTINGS, commands};

/// Silence after which a serial port is reopened.
const LIMIT: Duration = Duration::from_secs(5);

#[test]
fn a_silent_device_is_pinged_and_then_unresponsive() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let start = harness.now_us;
    for tick in 1..=51 {
        let now = at(start + tick * 100_000);
        harness.core.tick(now, &mut harness.recorder);
        assert_eq!(
            harness.core.is_unresponsive(now, LIMIT),
            tick > 50,
            "tick {tick}"
        );
        assert!(tick > 20 || harness.recorder.sent.is_empty());
    }
    let sent = std::mem::take(&mut harness.recorder.sent);
    harness.board.answer(&sent);
    assert_eq!(commands(&harness).last(), Some(&"ping"));
}

#[test]
fn a_suspended_host_does_not_count_as_silence_of_the_device() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let (start, mut waiting) = (harness.now_us, Vec::new());
    for code in 1..=160 {
        waiting.extend(
            harness
                .board
                .code((start + code * 62_500).unsigned_abs(), 1),
        );
    }
    harness.now_us = start + 10_000_000;
    harness.tick();
    assert!(!harness.core.is_unresponsive(at(harness.now_us), LIMIT));
    harness.receive(&waiting);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (160, 0));
}

#[test]
fn a_refused_start_is_not_repeated_for_ten_seconds() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.core.connected(at(0), &mut harness.recorder);
    for tick in 0..60 {
        harness.now_us = tick * 100_000;
        let sent = std::mem::take(&mut harness.recorder.sent);
        let seen = harness.board.received.len();
        let answers = harness.board.answer(&sent);
        let start = harness.board.received[seen..]
            .iter()
            .find(|(_, command)| matches!(command, ToDevice::Start(_)))
            .copied();
        match start {
            Some((of, _)) => {
                let refusal = link::Ack {
                    of,
                    result: AckResult::BadArgument,
                };
                let bytes = harness.board.frame(0, &ToHost::Ack(refusal));
                // The test discards the board's own acknowledgement, and the core counts a lost
                // frame. This test does not check that count.
                harness.receive(&bytes);
            }
            None => harness.receive(&answers),
        }
        harness.tick();
    }
    let starts = commands(&harness)
        .iter()
        .filter(|name| **name == "start")
        .count();
    assert_eq!(
        starts, 2,
        "codes, packed blocks in their place, and then nothing for 10 s"
    );
    harness.set_streaming(false);
    assert_eq!(
        commands(&harness).last(),
        Some(&"stop"),
        "only the start was refused"
    );
}

#[test]
fn a_device_that_falls_silent_at_the_start_is_unresponsive() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    harness.start_unacknowledged();
    let start = harness.now_us;
    for tick in 1..=51 {
        let now = at(start + tick * 100_000);
        harness.core.tick(now, &mut harness.recorder);
        assert_eq!(
            harness.core.is_unresponsive(now, LIMIT),
            tick > 50,
            "tick {tick}"
        );
    }
}

/// Advances time by `seconds` seconds. The board answers commands but sends no codes.
fn starve(harness: &mut Harness, seconds: i64) {
    for _ in 0..seconds * 10 {
        harness.now_us += 100_000;
        harness.tick();
        harness.exchange();
    }
}

#[test]
fn a_reset_with_a_lost_hello_is_detected_within_3_s() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.board.reboot();
    harness.board.hello();
    starve(&mut harness, 3);
    assert_eq!(commands(&harness)[3..], ["identify", "stop", "start"]);
    harness.code(1, false);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost, summary.resets), (2, 0, 1));
}

#[test]
fn a_device_that_another_program_stopped_is_started_again() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.board.streaming = false;
    starve(&mut harness, 3);
    assert_eq!(commands(&harness)[3..], ["identify", "start"]);
    harness.code(1, false);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (2, 0));
}

#[test]
fn a_device_that_answers_and_sends_no_codes_is_a_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    starve(&mut harness, 10);
    let report = harness.report("device");
    assert_has(&report, ["Warn", "sends no codes"]);
    let asked = commands(&harness).len() - 3;
    assert!((6..=12).contains(&asked), "{asked} commands in 10 s");
    harness.code(1, false);
    assert_eq!(harness.core.summary().received, 2);
    let report = harness.report("device");
    assert_has(&report, ["streaming"]);
}
