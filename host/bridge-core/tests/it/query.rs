//! Single requests to a device: self-test and reset.

use bridge_core::{Answer, Query, QueryError, QueryResult, Request, SelfTestReport};
use link::{
    AckResult, ChannelFault, ChannelTest, ChipTest, ResetInto, SelfTest, Streams, ToDevice, ToHost,
};

use crate::board::{Board, assert_has};

const FINE: ChannelTest = ChannelTest {
    gain_error: 0.0123,
    offset_uv: -41.26,
    noise_uv: 0.1449,
    shorted_noise_uv: 0.1381,
    fault: ChannelFault::None,
};

/// Returns a self-test result of eight chips without faults, modified by `change`.
fn result(change: impl FnOnce(&mut SelfTest)) -> SelfTest {
    let chip = ChipTest { id: 0x3E, ..ChipTest::default() };
    let mut test = SelfTest {
        fault: heapless::String::new(),
        drdy_millihertz: 512_005,
        expected_millihertz: 512_000,
        drdy_early: 0,
        drdy_missed: 0,
        chips: [chip; 8].into_iter().collect(),
        channels: [FINE; 64].into_iter().collect(),
    };
    change(&mut test);
    test
}

/// A query and a board that exchange bytes in virtual time. The electrodes are named E1, E2, ...
struct Harness {
    query: Query,
    board: Board,
    now_us: i64,
}

impl Harness {
    fn new(request: Request, mut board: Board) -> Harness {
        board.labels = (1..62).fold(String::new(), |all, number| format!("{all}E{number} "));
        let mut query = Query::new(request);
        query.connected(0);
        Harness { query, board, now_us: 0 }
    }

    /// Lets query and board exchange bytes for `us` microseconds, or until the query has a result.
    fn exchange_for(&mut self, us: i64) -> Option<QueryResult> {
        let end_us = self.now_us + us;
        while self.now_us < end_us {
            if let Some(outcome) = self.query.tick(self.now_us) {
                return Some(outcome);
            }
            let answers = self.board.answer(&self.query.outgoing());
            if let Some(outcome) = self.query.receive(&answers, self.now_us) {
                return Some(outcome);
            }
            self.now_us += 100_000;
        }
        None
    }

    fn send(&mut self, message: &ToHost) -> Option<QueryResult> {
        let bytes = self.board.frame(0, message);
        self.query.receive(&bytes, self.now_us)
    }

    fn requested(&self) -> Vec<ToDevice<'static>> {
        let received = self.board.received.iter();
        received.map(|(_, command)| *command).collect()
    }
}

fn report(test: SelfTest) -> SelfTestReport {
    let mut harness = Harness::new(Request::SelfTest, Board::new());
    assert!(harness.exchange_for(1_000_000).is_none());
    match answer_of(harness.send(&ToHost::SelfTest(test))) {
        Answer::SelfTest(report) => *report,
        other => panic!("{other:?}"),
    }
}

fn refusal(request: Request, ack_result: AckResult) -> QueryError {
    error_of(Harness::new(request, Board::answering(ack_result)).exchange_for(10_000_000))
}

#[track_caller]
fn error_of(outcome: Option<QueryResult>) -> QueryError {
    match outcome {
        Some(Err(error)) => error,
        other => panic!("{other:?}"),
    }
}

#[track_caller]
fn answer_of(outcome: Option<QueryResult>) -> Answer {
    match outcome {
        Some(Ok(answer)) => answer,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_device_is_identified_stopped_and_tested() {
    let mut harness = Harness::new(Request::SelfTest, Board::new());
    harness.board.streaming = true;
    assert!(harness.exchange_for(3_000_000).is_none());
    assert_eq!(harness.requested(), [ToDevice::Identify, ToDevice::Stop, ToDevice::SelfTest]);
    assert!(!harness.board.streaming);
    // The query ignores messages that are neither an acknowledgement nor a result of a self-test.
    let stats = harness.board.stats(Streams::empty());
    assert!(harness.query.receive(&stats, harness.now_us).is_none());
    let outcome = harness.send(&ToHost::SelfTest(result(|_| {})));
    assert!(matches!(outcome, Some(Ok(Answer::SelfTest(_)))));
}

#[test]
fn the_table_of_a_device_in_order_ends_with_that_verdict() {
    let report = report(result(|_| {}));
    assert!(report.passed);
    let text = report.to_string();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[..7],
        [
            "device  board, firmware test, uid 070707070707070707070707, started by power on",
            "DRDY    512.005 Hz, +10 ppm off the 512 Hz that were set; 0 early, 0 missed",
            "",
            "chip  ID                        registers  frames bad",
            "   0  0x3E ADS1299, 8 channels  all kept            0",
            "   1  0x3E ADS1299, 8 channels  all kept            0",
            "   2  0x3E ADS1299, 8 channels  all kept            0",
        ]
    );
    assert_eq!(
        lines[13..16],
        [
            "channel  electrode  gain error %  offset uV  noise uV rms  shorted uV rms  verdict",
            "      1  E1                +1.23      -41.3          0.14            0.14  in order",
            "      2  E2                +1.23      -41.3          0.14            0.14  in order",
        ]
    );
    assert!(lines[77].starts_with("     64  exg3  "), "{}", lines[77]);
    assert_eq!(lines[78..], ["", "all in order: 8 chips, 64 channels"]);
}

#[test]
fn faults_are_in_their_rows_and_in_the_last_line() {
    let report = report(result(|test| {
        test.fault.push_str("chip 1, channel 3: gain").unwrap();
        test.chips[1].registers_wrong = 2;
        test.chips[1].first_wrong = 0x05;
        test.chips[1].frames_bad = 17;
        test.chips[2].id = 0;
        test.chips[3].registers_wrong = 1;
        test.chips[3].first_wrong = 0x77;
        test.channels[10].fault = ChannelFault::Gain;
        test.channels[10].gain_error = -1.0;
        test.channels[61].fault = ChannelFault::Newer(9);
        test.drdy_millihertz = 0;
        test.drdy_missed = 3;
    }));
    assert!(!report.passed);
    let text = report.to_string();
    for line in [
        "DRDY    not measured, 512 Hz were set; 0 early, 3 missed",
        "   1  0x3E ADS1299, 8 channels  2 wrong, the first is CH1SET (0x05)          17",
        "   2  0x00 no answer            all kept                                      0",
        "   3  0x3E ADS1299, 8 channels  1 wrong, the first is 0x77                    0",
        "     11  E11             -100.00      -41.3          0.14            0.14  wrong gain",
        "     62  exg1              +1.23      -41.3          0.14            0.14  fault 9, newer than this bridge",
        "NOT IN ORDER: chip 1, channel 3: gain; 3 of 8 chips; 2 of 64 channels",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
}

#[test]
fn a_test_that_stopped_early_is_not_in_order() {
    let report = report(result(|test| {
        test.chips.truncate(1);
        test.channels.clear();
    }));
    assert!(!report.passed);
    let verdict = "NOT IN ORDER: 64 of 64 channels not measured";
    assert_eq!(report.verdict, verdict);
    assert!(!report.to_string().contains("electrode"));
}

#[test]
fn a_missing_figure_is_a_dash_in_the_table_and_null_in_json() {
    let report = report(result(|test| {
        // Channel 0 was not measured, because DRDY was missing. Channel 1 had only bad frames.
        // Channel 2 had too few samples to separate the two levels of the square wave. On channel 3
        // the test stopped before the inputs were shorted. Channel 4 was measured, but has no
        // signal.
        test.channels[0] = ChannelTest::default();
        test.channels[1] = ChannelTest {
            gain_error: -1.0,
            fault: ChannelFault::Samples,
            ..ChannelTest::default()
        };
        test.channels[2] = ChannelTest {
            gain_error: -1.0,
            offset_uv: 900.0,
            fault: ChannelFault::Samples,
            ..FINE
        };
        test.channels[3].shorted_noise_uv = 0.0;
        test.channels[4] = ChannelTest {
            gain_error: -1.0,
            offset_uv: -937.5,
            noise_uv: 0.0,
            shorted_noise_uv: 0.0,
            fault: ChannelFault::Gain,
        };
    }));
    let text = report.to_string();
    for line in [
        "      1  E1                    -          -             -               -  not measured",
        "      2  E2                    -          -             -               -  too few samples",
        "      3  E3                    -          -             -            0.14  too few samples",
        "      4  E4                +1.23      -41.3          0.14               -  not measured",
        "      5  E5              -100.00     -937.5          0.00            0.00  wrong gain",
        "NOT IN ORDER: 3 of 64 channels; 2 of 64 channels not measured",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    let json: serde_json::Value = serde_json::to_value(&report).unwrap();
    let first = &json["channels"][0];
    for figure in ["gain_error_percent", "offset_uv", "noise_uv", "shorted_noise_uv"] {
        assert!(first[figure].is_null(), "{figure}");
    }
    assert_eq!(first["in_order"], false);
}

#[test]
fn the_report_is_json_with_the_same_figures() {
    let report = report(result(|test| test.channels[1].noise_uv = f32::NAN));
    let json: serde_json::Value = serde_json::to_value(&report).unwrap();
    assert_eq!(json["device"]["board"], "board");
    assert_eq!(json["ready"]["rate_hz"], 512.005);
    assert_eq!(json["chips"][7]["part"], "ADS1299, 8 channels");
    assert_eq!(json["channels"][63]["label"], "exg3");
    assert_eq!(json["channels"][0]["verdict"], "in order");
    assert!(json["channels"][1]["noise_uv"].is_null());
    assert_eq!(json["passed"], true);
}

#[test]
fn refusals_have_a_reason_and_advice() {
    let test = Request::SelfTest;
    let [bootloader, firmware] = [ResetInto::Bootloader, ResetInto::Firmware].map(Request::Reset);
    for (request, answer, expected) in [
        (test, AckResult::UnknownCommand, "update the firmware"),
        (test, AckResult::NotSupported, "no converters"),
        (test, AckResult::Busy, "end that program"),
        (test, AckResult::Failed, "corticode-bridge reset"),
        (test, AckResult::Newer(77), "same release"),
        (bootloader, AckResult::NotSupported, "BOOT0"),
        (firmware, AckResult::UnknownCommand, "update the firmware"),
    ] {
        let error = refusal(request, answer);
        assert_eq!(error.exit_code(), 4, "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn a_silent_device_times_out() {
    let mut harness = Harness::new(Request::SelfTest, Board::new());
    let silent = |harness: &mut Harness| {
        let mut us = 0;
        loop {
            us += 100_000;
            match harness.query.tick(us) {
                Some(Err(error)) => return (us, error),
                Some(Ok(answer)) => panic!("{answer:?}"),
                None => drop(harness.query.outgoing()),
            }
        }
    };
    let (us, error) = silent(&mut harness);
    assert_eq!((us, error.exit_code()), (5_100_000, 3));
    assert_has(&error.to_string(), ["the identification request"]);
    // After it has acknowledged the command, the device has 15 s to send the result.
    let mut harness = Harness::new(Request::SelfTest, Board::new());
    assert!(harness.exchange_for(15_000_000).is_none());
    let error = error_of(harness.exchange_for(1_000_000));
    assert_has(&error.to_string(), ["the result of the self-test"]);
}

#[test]
fn a_lost_acknowledgement_of_the_test_is_no_refusal() {
    let mut harness = Harness::new(Request::SelfTest, Board::new());
    while harness.requested().last() != Some(&ToDevice::SelfTest) {
        assert!(harness.query.tick(harness.now_us).is_none());
        let answers = harness.board.answer(&harness.query.outgoing());
        if harness.requested().last() != Some(&ToDevice::SelfTest) {
            assert!(harness.query.receive(&answers, harness.now_us).is_none());
        }
        harness.now_us += 100_000;
    }
    // The device refuses the repeated command as busy, because its self-test is already running.
    harness.board.ack_result = AckResult::Busy;
    assert!(harness.exchange_for(2_000_000).is_none());
    let outcome = harness.send(&ToHost::SelfTest(result(|_| {})));
    assert!(matches!(outcome, Some(Ok(Answer::SelfTest(_)))));
}

#[test]
fn a_reset_is_complete_when_hello_has_another_session() {
    let mut harness = Harness::new(Request::Reset(ResetInto::Firmware), Board::new());
    let early = harness.exchange_for(2_000_000);
    assert!(early.is_none(), "the device has not restarted yet");
    assert!(harness.query.expects_reconnect());
    harness.board.reboot();
    harness.query.connected(harness.now_us);
    let Answer::Restarted(device) = answer_of(harness.exchange_for(1_000_000)) else {
        panic!("no restart")
    };
    assert_eq!(device.reset_cause, "power on");
}

#[test]
fn a_restart_during_the_test_is_an_error_with_its_cause() {
    let mut harness = Harness::new(Request::SelfTest, Board::new());
    assert!(harness.exchange_for(2_000_000).is_none());
    harness.board.reboot();
    let hello = harness.board.hello();
    let error = error_of(harness.query.receive(&hello, harness.now_us));
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().contains("started by power on"), "{error}");
}

#[test]
fn a_reset_into_the_bootloader_ends_with_the_acknowledgement() {
    let mut harness = Harness::new(Request::Reset(ResetInto::Bootloader), Board::new());
    let answer = answer_of(harness.exchange_for(1_000_000));
    assert!(matches!(answer, Answer::InBootloader(_)), "{answer:?}");
    let requested = harness.requested().pop();
    assert_eq!(requested, Some(ToDevice::Reset(ResetInto::Bootloader)));
}

#[test]
fn a_device_that_is_identified_goes_on_streaming() {
    let mut harness = Harness::new(Request::Identify, Board::new());
    harness.board.streaming = true;
    let Answer::Identified(device) = answer_of(harness.exchange_for(1_000_000)) else {
        panic!("not identified")
    };
    let model = artifact::ModelId(harness.board.model_id).to_string();
    assert_eq!((device.board.as_str(), device.model), ("board", model));
    assert_eq!(harness.requested(), [ToDevice::Identify]);
    assert!(harness.board.streaming);
}

#[test]
fn noise_is_ignored() {
    let mut harness = Harness::new(Request::SelfTest, Board::new());
    let noise: Vec<u8> = (0..50_000_u32).map(|n| ((n * n) >> 3).to_le_bytes()[1]).collect();
    assert!(harness.query.receive(&noise, 0).is_none());
    assert!(harness.exchange_for(2_000_000).is_none());
    assert_eq!(harness.requested().last(), Some(&ToDevice::SelfTest));
}
