//! Connections, reboots, starts and stops of a device, and devices that fall silent or refuse
//! commands.

use std::time::Duration;

use link::{AckResult, Streams, ToDevice, ToHost};

use crate::board::{Board, assert_has, at};
use crate::recorder::{Harness, SETTINGS, commands};

#[test]
fn a_device_is_identified_stopped_and_started() {
    let harness = Harness::streaming(SETTINGS, Board::new());
    assert_eq!(commands(&harness), ["identify", "stop", "start"]);
    assert_eq!(harness.recorder.announced.len(), 1);
    assert!(harness.recorder.announced[0].decodable);
}

#[test]
fn commands_without_an_answer_are_repeated() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.core.connected(at(0), &mut harness.recorder);
    for tick in 1..=20 {
        harness.core.tick(at(tick * 100_000), &mut harness.recorder);
    }
    let sent = std::mem::take(&mut harness.recorder.sent);
    harness.board.answer(&sent);
    // `Identify` is sent at 0 s and then every 0.5 s, for the fifth time at 2 s.
    assert_eq!(commands(&harness), ["identify"; 5]);
}

#[test]
fn a_lost_acknowledgement_of_start_costs_no_code() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    for _ in 0..3 {
        let commands = std::mem::take(&mut harness.recorder.sent);
        let answers = harness.board.answer(&commands);
        // The acknowledgement of the first `Start` does not reach the core.
        if harness.board.received.len() < 3 {
            harness.receive(&answers);
        }
    }
    assert_eq!(commands(&harness), ["identify", "stop", "start"]);
    for _ in 0..20 {
        harness.code(1, false);
        // A streaming board acknowledges a repeated `Start` and keeps streaming.
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
    assert_eq!(
        harness.recorder.announced.len(),
        1,
        "the same device is announced once"
    );
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
fn an_outage_of_the_port_is_counted_and_filled() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.core.disconnected();
    harness.lose(16);
    harness.connect();
    harness.code(2, false);
    assert_eq!(
        commands(&harness)[3..],
        ["identify", "start"],
        "a stream that this bridge started is not stopped"
    );
    let summary = harness.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.fillers),
        (2, 16, 16)
    );
    assert_eq!(summary.connections, 2);
}

#[test]
fn a_thousand_outages_are_counted_exactly() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let (mut received, mut lost) = (0, 0);
    for outage in 0..1000 {
        let missing = outage % 7;
        harness.core.disconnected();
        // The cable is unplugged during a frame, so only half of the frame arrives.
        let half = harness
            .board
            .frame(0, &ToHost::Stats(link::Stats::default()));
        harness.receive(&half[..half.len() / 2]);
        harness.lose(missing);
        harness.connect();
        harness.code(2, false);
        received += 1;
        lost += missing;
    }
    let summary = harness.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.fillers),
        (received, lost, lost)
    );
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
    assert_eq!(
        (harness.recorder.encoded.len(), harness.core.summary().lost),
        (2, 0)
    );
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
    let summary = harness.core.summary();
    assert_eq!(
        (summary.made, summary.lost),
        (2, 1),
        "the last report counts the lost code"
    );
}

#[test]
fn a_report_from_before_the_start_counts_no_loss() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.codes(20, 1);
    harness.set_streaming(false);
    // After a reconnection the device is stopped again. The `Stats` that follow still count the
    // codes of the previous stream.
    harness.core.disconnected();
    harness.connect();
    assert_eq!(commands(&harness)[3..], ["stop", "identify", "stop"]);
    harness.core.set_streaming(true);
    harness.tick();
    harness.stats(Streams::empty());
    harness.exchange();
    harness.code(2, false);
    let summary = harness.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.fillers),
        (21, 0, 0)
    );
}

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
