//! Clock queries, whose answers bound the time by which stamps are late.

use link::{AckResult, ClockReading, ToDevice, ToHost};

use crate::board::Board;
use crate::recorder::{Harness, SETTINGS, commands, stamps};

/// Delivers codes for `seconds` seconds, and lets the board answer the core's commands.
fn run(harness: &mut Harness, seconds: u32) {
    for _ in 0..seconds * 16 {
        harness.code(1, false);
        harness.exchange();
    }
}

fn clock_queries(harness: &Harness) -> Vec<u64> {
    let seen = harness.board.received.iter();
    seen.filter_map(|(_, command)| match command {
        ToDevice::SyncTime { host_time_us } => Some(*host_time_us),
        _ => None,
    })
    .collect()
}

/// Checks that the status `clock` contains no round trip.
#[track_caller]
fn assert_no_round_trip(harness: &mut Harness) {
    let report = harness.report("clock");
    assert!(!report.contains("round trip us"), "{report}");
}

#[test]
fn a_clock_query_is_sent_every_ten_seconds_while_codes_arrive() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    run(&mut harness, 33);
    let asked = clock_queries(&harness);
    assert_eq!(asked.len(), 4, "{asked:?}");
    for pair in asked.windows(2) {
        let apart_us = pair[1] - pair[0];
        assert!((10_000_000..10_100_000).contains(&apart_us), "{apart_us}");
    }
}

#[test]
fn a_device_that_does_not_know_the_query_is_not_queried_again() {
    let board = Board::answering(AckResult::UnknownCommand);
    let mut harness = Harness::streaming(SETTINGS, board);
    run(&mut harness, 30);
    assert_eq!(clock_queries(&harness).len(), 1);
    assert_eq!(commands(&harness).len(), 4);
    assert_no_round_trip(&mut harness);
}

#[test]
fn the_shortest_round_trip_bounds_the_delay_of_stamps() {
    // The host reads each code 4 ms after the code's last sample, a delay that the fit cannot
    // detect. A query takes 0.3 ms to the device. The device makes the answer 0.1 ms later. The
    // answer takes 0.5 ms to the host, plus `longer` microseconds.
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    for longer in [700, 0, 2000] {
        let before = clock_queries(&harness).len();
        while clock_queries(&harness).len() == before {
            harness.now_us += 62_500;
            let made = harness.now_us.unsigned_abs() - 4_000;
            let code = harness.board.code(made, 1);
            harness.receive(&code);
            harness.exchange();
        }
        let asked = *clock_queries(&harness).last().unwrap();
        harness.now_us = asked.cast_signed() + 900 + longer;
        let reading = ClockReading { host_time_us: asked, received_us: asked + 300 };
        harness.send(asked + 400, &ToHost::ClockReading(reading));
        harness.now_us = asked.cast_signed();
    }
    let mut figure = |key| harness.figure("clock", key);
    assert_eq!(figure("round trip us"), "800");
    assert_eq!(figure("offset known to +- us"), "400");
    // Lower bound: 4000 us less the 500 us of the answer. Upper bound: 4000 us plus the 300 us of
    // the query.
    assert_eq!(figure("stamps late by us"), "3500 to 4300");
    // After a minute the round trips are discarded.
    run(&mut harness, 61);
    assert_no_round_trip(&mut harness);
}

/// Delivers `count` codes of the board, whose run began at the host time `run_us`. The host reads
/// each code 4 ms after it was made, and the first code `late_us` later than that.
fn run_of_codes(harness: &mut Harness, run_us: i64, count: i64, mut late_us: i64) {
    let zero_us = harness.board.zero_us.unwrap();
    for hop in 1..=count {
        let made_us = run_us + hop * 62_500;
        harness.now_us = made_us + 4_000 + std::mem::take(&mut late_us);
        let code = harness.board.code((made_us - zero_us).cast_unsigned(), 1);
        harness.receive(&code);
        harness.exchange();
    }
}

#[test]
fn after_a_restart_queries_before_the_start_show_when_the_run_begins() {
    // Without an answer before the restart, the bridge does not know that the first code is
    // delayed, and publishes one filler more.
    for (answers, asked, fillers) in [(true, 5, 32), (false, 0, 33)] {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        harness.board.zero_us = Some(harness.now_us);
        let run_us = harness.now_us;
        // The first query is due 1 s after the start.
        run_of_codes(&mut harness, run_us, if answers { 48 } else { 8 }, 0);
        let before = harness.board.received.len();
        let frames = harness.recorder.encoded.len();
        // The outage and the new run's first hop together last 33 hops.
        let run_us = harness.now_us - 4_000 + 32 * 62_500;
        harness.board.zero_us = Some(run_us);
        harness.reboot(run_us - harness.now_us);
        let restarted = harness.board.received[before..].iter();
        let restarted: Vec<ToDevice> = restarted.map(|(_, command)| *command).collect();
        let is_query = |command: &&ToDevice| matches!(command, ToDevice::SyncTime { .. });
        assert_eq!(restarted.iter().filter(is_query).count(), asked);
        assert!(matches!(restarted.last(), Some(ToDevice::Start(_))));
        run_of_codes(&mut harness, run_us, 4, 66_000);
        assert_eq!(harness.recorder.encoded.len(), frames + fillers + 4);
        if answers {
            let stamps = stamps(&harness.recorder.encoded);
            let rows = i64::try_from(frames + fillers).unwrap();
            let off_ns = stamps[frames + fillers] - (stamps[0] + rows * 62_500_000);
            assert!(off_ns.abs() < 1_000_000, "{off_ns} ns");
        }
    }
}

#[test]
fn unanswered_queries_delay_the_start_by_half_a_second_at_most() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.board.zero_us = Some(harness.now_us);
    let run_us = harness.now_us;
    run_of_codes(&mut harness, run_us, 48, 0);
    harness.board.zero_us = None;
    harness.board.reboot();
    let hello = harness.board.hello();
    harness.receive(&hello);
    let restarted_us = harness.now_us;
    while !harness.board.streaming {
        let lost = harness.board.received.len();
        let answers = harness.answers();
        let queried = harness.board.received[lost..].iter();
        if queried.clone().all(|(_, command)| !matches!(command, ToDevice::SyncTime { .. })) {
            harness.receive(&answers);
        }
        harness.now_us += 10_000;
        harness.tick();
    }
    let waited_us = harness.now_us - restarted_us;
    assert!((500_000..600_000).contains(&waited_us), "{waited_us}");
}

#[test]
fn answers_without_a_query_or_with_impossible_times_are_counted() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let send_reading = |harness: &mut Harness, host_time_us, received_us, made_us| {
        let reading = ClockReading { host_time_us, received_us };
        harness.send(made_us, &ToHost::ClockReading(reading));
    };
    send_reading(&mut harness, 5, 0, 0);
    run(&mut harness, 3);
    let asked = clock_queries(&harness)[0];
    for (host, received, made) in [
        (asked + 1, 10, 20),
        (asked, 20, 10),
        // Here the time inside the device would be longer than the time from query to answer.
        (asked, 0, u64::MAX),
        (asked, 0, 3_000_000),
    ] {
        send_reading(&mut harness, host, received, made);
    }
    assert_eq!(harness.figure("clock", "impossible answers"), "5");
    assert_no_round_trip(&mut harness);
}
