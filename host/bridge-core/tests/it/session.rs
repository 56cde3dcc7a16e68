//! Connections, reboots, starts and stops of a device, and devices that stop sending or refuse
//! commands.

use std::time::Duration;

use link::{AckResult, Streams, ToDevice, ToHost};

use crate::board::{Board, assert_has, at};
use crate::recorder::{Harness, SETTINGS, commands};

#[test]
fn commands_without_an_answer_are_repeated() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    for _ in 0..20 {
        harness.now_us += 100_000;
        harness.tick();
    }
    harness.answers();
    // The core sends `Identify` at 0 s and then every 0.5 s, for the fifth time at 2 s.
    assert_eq!(commands(&harness), ["identify"; 5]);
}

#[test]
fn a_lost_acknowledgement_of_start_costs_no_code() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    harness.start_unacknowledged();
    assert_eq!(commands(&harness), ["identify", "stop", "start"]);
    for _ in 0..20 {
        harness.code(1, false);
        // A board that streams acknowledges a repeated `Start` and goes on streaming.
        harness.exchange();
    }
    assert_eq!(commands(&harness).len(), 4);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (20, 0));
}

#[test]
fn a_reset_is_counted_and_costs_no_code() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.codes(5, 1);
    harness.reboot(0);
    assert_eq!(commands(&harness).last(), Some(&"start"));
    harness.codes(5, 2);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost, summary.resets), (10, 0, 1));
    let announced = harness.recorder.announced.len();
    assert_eq!(announced, 1, "the same device is announced once");
}

#[test]
fn a_reset_with_a_lost_hello_is_detected_by_old_frame_numbers() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.codes(30, 1);
    harness.board.reboot();
    harness.board.hello();
    for _ in 0..8 {
        harness.stats(Streams::empty());
    }
    harness.exchange();
    harness.code(2, false);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost, summary.resets), (31, 0, 1));
}

#[test]
fn a_thousand_outages_are_counted_exactly_and_filled() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let (mut received, mut lost) = (0, 0);
    for outage in 0..1000 {
        let missing = outage % 7;
        harness.core.disconnected();
        // The cable is unplugged during a frame, so only half of that frame arrives.
        let stats = ToHost::Stats(link::Stats::default());
        let half = harness.board.frame(0, &stats);
        harness.receive(&half[..half.len() / 2]);
        harness.lose(missing);
        harness.connect();
        harness.code(2, false);
        received += 1;
        lost += missing;
    }
    // After its first commands the bridge sends no `Stop` when it reconnects, because it started
    // the stream itself.
    let mut sent = commands(&harness);
    sent.retain(|name| *name != "sync time");
    assert!(sent[3..].chunks(2).all(|pair| pair == ["identify", "start"]));
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (received, lost));
    assert_eq!(summary.fillers, lost);
    assert_eq!((summary.connections, summary.resets), (1001, 0));
}

#[test]
fn a_stream_restarted_during_an_outage_is_continued() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.codes(10, 1);
    harness.core.disconnected();
    harness.board.streaming = false;
    harness.connect();
    harness.codes(3, 2);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (13, 0));
}

#[test]
fn codes_before_the_introduction_are_counted_and_not_published() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    harness.code(1, false);
    assert!(harness.recorder.encoded.is_empty());
    assert_eq!(harness.core.summary().unused, 1);
}

#[test]
fn a_device_that_stops_by_itself_is_started_again() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.board.streaming = false;
    harness.stats(Streams::empty());
    harness.exchange();
    assert_eq!(commands(&harness)[3..], ["start"]);
    harness.code(2, false);
    assert_eq!(harness.core.summary().lost, 0);
}

#[test]
fn streaming_can_be_stopped_and_started() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.set_streaming(false);
    assert!(harness.core.is_stopped());
    harness.set_streaming(true);
    harness.code(2, false);
    assert_eq!(commands(&harness)[3..], ["stop", "start"]);
    assert_eq!(harness.recorder.encoded.len(), 2);
    assert_eq!(harness.core.summary().lost, 0);
}

#[test]
fn an_unacknowledged_start_is_stopped_at_shutdown() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    harness.start_unacknowledged();
    harness.code(1, false);
    harness.core.set_streaming(false);
    assert!(!harness.core.is_stopped());
    harness.code(1, true);
    harness.tick();
    harness.exchange();
    assert_eq!(commands(&harness), ["identify", "stop", "start", "stop"]);
    assert!(harness.core.is_stopped());
    // The `Stats` that the board sends when it is stopped reveals the lost code.
    let summary = harness.core.summary();
    assert_eq!((summary.made, summary.lost), (2, 1));
}

#[test]
fn a_report_from_before_the_start_counts_no_loss() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.codes(8, 1);
    harness.set_streaming(false);
    // After a reconnection the core stops the device again. The `Stats` that follows still counts
    // the codes of the previous stream.
    harness.core.disconnected();
    harness.connect();
    assert_eq!(commands(&harness)[3..], ["stop", "identify", "stop"]);
    harness.core.set_streaming(true);
    harness.tick();
    harness.stats(Streams::empty());
    harness.exchange();
    harness.code(2, false);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (9, 0));
    assert_eq!(summary.fillers, 0);
}

/// Time without a frame after which the bridge reopens a serial port.
const LIMIT: Duration = Duration::from_secs(5);

/// Lets 5.1 s pass without a frame from the device, and checks that it is unresponsive after 5 s.
fn stay_silent(harness: &mut Harness) {
    for tick in 1..=51 {
        harness.now_us += 100_000;
        harness.tick();
        let now = at(harness.now_us);
        let is_unresponsive = harness.core.is_unresponsive(now, LIMIT);
        assert_eq!(is_unresponsive, tick > 50, "tick {tick}");
    }
}

#[test]
fn a_silent_device_is_pinged_and_then_unresponsive() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    for _ in 0..20 {
        harness.now_us += 100_000;
        harness.tick();
    }
    assert!(harness.recorder.sent.is_empty(), "a ping within 2 s");
    harness.stats(Streams::CODES);
    stay_silent(&mut harness);
    harness.answers();
    assert_eq!(commands(&harness).last(), Some(&"ping"));
}

#[test]
fn a_suspended_host_does_not_count_as_silence_of_the_device() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let mut waiting = Vec::new();
    for _ in 0..160 {
        harness.now_us += 62_500;
        waiting.extend(harness.board.code(harness.now_us.unsigned_abs(), 1));
    }
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
        let seen = harness.board.received.len();
        let answers = harness.answers();
        let mut new = harness.board.received[seen..].iter();
        let start = new.find(|(_, command)| matches!(command, ToDevice::Start(_)));
        match start.copied() {
            Some((of, _)) => {
                let result = AckResult::BadArgument;
                // The board's own acknowledgement is discarded, so the core counts a lost frame,
                // which does not matter here.
                harness.send(0, &ToHost::Ack(link::Ack { of, result }));
            }
            None => harness.receive(&answers),
        }
        harness.tick();
    }
    // The core asked for codes, then for packed blocks in their place, and then not again for 10 s.
    let commands_before = commands(&harness);
    let starts = commands_before.iter().filter(|name| **name == "start");
    assert_eq!(starts.count(), 2, "{commands_before:?}");
    harness.set_streaming(false);
    let last = commands(&harness).pop();
    assert_eq!(last, Some("stop"), "only the start was refused");
}

#[test]
fn a_device_that_falls_silent_at_the_start_is_unresponsive() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    harness.start_unacknowledged();
    stay_silent(&mut harness);
}

/// Advances time by `seconds` seconds, in which the board answers commands but sends no codes.
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
    assert_has(&harness.report("device"), ["Warn", "sends no codes"]);
    let asked = commands(&harness).len() - 3;
    assert!((6..=12).contains(&asked), "{asked} commands in 10 s");
    harness.code(1, false);
    assert_eq!(harness.core.summary().received, 2);
    assert_has(&harness.report("device"), ["streaming"]);
}
