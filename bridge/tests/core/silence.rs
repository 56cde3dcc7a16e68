//! Devices that say nothing, or no.

use link::{AckResult, ToDevice, ToHost};

use crate::board::{Board, at};
use crate::recorder::{Desk, SETTINGS, commands};

#[test]
fn a_silent_device_is_pinged_and_then_taken_for_dead() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    let start = desk.now_us;
    for tick in 1..=51 {
        let now = at(start + tick * 100_000);
        desk.core.tick(now, &mut desk.recorder);
        assert_eq!(desk.core.is_dead(now), tick > 50, "tick {tick}");
        assert!(tick > 20 || desk.recorder.sent.is_empty());
    }
    let sent = std::mem::take(&mut desk.recorder.sent);
    desk.board.answer(&sent);
    assert_eq!(commands(&desk).last(), Some(&"ping"));
}

#[test]
fn a_host_that_slept_does_not_take_the_device_for_dead() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    let (start, mut waiting) = (desk.now_us, Vec::new());
    for code in 1..=160 {
        waiting.extend(desk.board.code((start + code * 62_500).unsigned_abs(), 1));
    }
    desk.now_us = start + 10_000_000;
    desk.core.tick(at(desk.now_us), &mut desk.recorder);
    assert!(!desk.core.is_dead(at(desk.now_us)));
    desk.receive(&waiting);
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost), (160, 0));
}

#[test]
fn a_refused_start_is_not_hammered() {
    let mut desk = Desk::new(SETTINGS, Board::new());
    desk.core.connected(at(0), &mut desk.recorder);
    for tick in 0..60 {
        desk.now_us = tick * 100_000;
        let sent = std::mem::take(&mut desk.recorder.sent);
        let seen = desk.board.seen.len();
        let answers = desk.board.answer(&sent);
        let start = desk.board.seen[seen..]
            .iter()
            .find(|(_, command)| matches!(command, ToDevice::Start(_)))
            .copied();
        match start {
            Some((of, _)) => {
                let refusal = link::Ack {
                    of,
                    result: AckResult::BadArgument,
                };
                let bytes = desk.board.frame(0, &ToHost::Ack(refusal));
                // The frames of the answer that is thrown away count as lost; that is no matter.
                desk.receive(&bytes);
            }
            None => desk.receive(&answers),
        }
        desk.core.tick(at(desk.now_us), &mut desk.recorder);
    }
    let starts = commands(&desk)
        .iter()
        .filter(|name| **name == "start")
        .count();
    assert_eq!(starts, 1, "6 s, and a refusal holds for 10 s");
    desk.core.want(false);
    desk.core.tick(at(desk.now_us), &mut desk.recorder);
    desk.converse();
    assert_eq!(
        commands(&desk).last(),
        Some(&"stop"),
        "what was refused is the start alone"
    );
}

#[test]
fn a_device_that_falls_silent_at_the_start_is_taken_for_dead() {
    let mut desk = Desk::new(SETTINGS, Board::new());
    desk.core.connected(at(desk.now_us), &mut desk.recorder);
    while desk.board.seen.len() < 3 {
        let sent = std::mem::take(&mut desk.recorder.sent);
        let answers = desk.board.answer(&sent);
        if desk.board.seen.len() < 3 {
            desk.receive(&answers);
        }
    }
    let start = desk.now_us;
    for tick in 1..=51 {
        let now = at(start + tick * 100_000);
        desk.core.tick(now, &mut desk.recorder);
        assert_eq!(desk.core.is_dead(now), tick > 50, "tick {tick}");
    }
}

/// Let `seconds` pass with a board that answers and makes no codes.
fn starve(desk: &mut Desk, seconds: i64) {
    for _ in 0..seconds * 10 {
        desk.now_us += 100_000;
        desk.core.tick(at(desk.now_us), &mut desk.recorder);
        desk.converse();
    }
}

#[test]
fn a_reset_whose_hello_was_lost_shows_within_3_s() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    desk.board.reboot();
    desk.board.hello();
    starve(&mut desk, 3);
    assert_eq!(commands(&desk)[3..], ["identify", "stop", "start"]);
    desk.code(1, false);
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost, summary.resets), (2, 0, 1));
}

#[test]
fn a_device_that_someone_else_stopped_is_started_again() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    desk.board.streaming = false;
    starve(&mut desk, 3);
    assert_eq!(commands(&desk)[3..], ["identify", "start"]);
    desk.code(1, false);
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost), (2, 0));
}

#[test]
fn a_device_that_answers_but_makes_no_codes_is_told_of() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    starve(&mut desk, 10);
    let report = format!("{:?}", desk.core.diagnostics(at(desk.now_us)).status[0]);
    assert!(
        report.contains("Warn") && report.contains("sends no codes"),
        "{report}"
    );
    let asked = commands(&desk).len() - 3;
    assert!((6..=12).contains(&asked), "{asked} commands in 10 s");
    desk.code(1, false);
    assert_eq!(desk.core.summary().received, 2);
    let report = format!("{:?}", desk.core.diagnostics(at(desk.now_us)).status[0]);
    assert!(report.contains("streaming"), "{report}");
}
