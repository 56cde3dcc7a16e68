//! One question to a device: a self-test, a reset.

use bridge::{Answer, BridgeError, Inquiry, Outcome, Question, SelfTestReport};
use link::{
    AckResult, ChannelFault, ChannelTest, ChipTest, ResetInto, SelfTest, Streams, ToDevice, ToHost,
};

use crate::board::Board;

const FINE: ChannelTest = ChannelTest {
    gain_error: 0.0123,
    offset_uv: -41.26,
    noise_uv: 0.1449,
    shorted_noise_uv: 0.1381,
    fault: ChannelFault::None,
};

/// What a device of eight chips in order says, but for what `change` changes.
fn result(change: impl FnOnce(&mut SelfTest)) -> SelfTest {
    let chip = ChipTest {
        id: 0x3E,
        ..ChipTest::default()
    };
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

/// An inquiry and a board.
struct Desk {
    inquiry: Inquiry,
    board: Board,
    now_us: i64,
}

impl Desk {
    fn new(question: Question, board: Board) -> Desk {
        let mut inquiry = Inquiry::new(question);
        inquiry.connected(0);
        Desk {
            inquiry,
            board,
            now_us: 0,
        }
    }

    /// Let both talk for so long; the outcome, if there is one.
    fn talk(&mut self, us: i64) -> Option<Outcome> {
        let end_us = self.now_us + us;
        while self.now_us < end_us {
            if let Some(outcome) = self.inquiry.tick(self.now_us) {
                return Some(outcome);
            }
            let answers = self.board.answer(&self.inquiry.outgoing());
            if let Some(outcome) = self.inquiry.receive(&answers, self.now_us) {
                return Some(outcome);
            }
            self.now_us += 100_000;
        }
        None
    }

    fn say(&mut self, message: &ToHost) -> Option<Outcome> {
        let bytes = self.board.frame(0, message);
        self.inquiry.receive(&bytes, self.now_us)
    }

    fn asked(&self) -> Vec<ToDevice> {
        self.board
            .seen
            .iter()
            .map(|(_, command)| *command)
            .collect()
    }
}

fn report(test: SelfTest) -> SelfTestReport {
    let mut desk = Desk::new(Question::SelfTest, Board::new());
    assert!(desk.talk(1_000_000).is_none());
    match desk.say(&ToHost::SelfTest(test)) {
        Some(Ok(Answer::SelfTest(report))) => *report,
        other => panic!("{other:?}"),
    }
}

fn refusal(question: Question, answers: AckResult) -> BridgeError {
    let board = Board {
        answers,
        ..Board::new()
    };
    match Desk::new(question, board).talk(10_000_000) {
        Some(Err(error)) => error,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_device_is_asked_who_it_is_stopped_and_tested() {
    let mut desk = Desk::new(Question::SelfTest, Board::new());
    desk.board.streaming = true;
    assert!(desk.talk(3_000_000).is_none());
    assert_eq!(
        desk.asked(),
        [ToDevice::Identify, ToDevice::Stop, ToDevice::SelfTest]
    );
    assert!(!desk.board.streaming);
    // What else it says is no answer.
    let stats = desk.board.stats(Streams::empty());
    assert!(desk.inquiry.receive(&stats, desk.now_us).is_none());
    let outcome = desk.say(&ToHost::SelfTest(result(|_| {})));
    assert!(matches!(outcome, Some(Ok(Answer::SelfTest(_)))));
}

#[test]
fn a_device_in_order_gets_a_table_that_says_so_at_its_end() {
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
            "      1  F3                +1.23      -41.3          0.14            0.14  in order",
            "      2  F1                +1.23      -41.3          0.14            0.14  in order",
        ]
    );
    assert!(lines[77].starts_with("     64  exg3  "), "{}", lines[77]);
    assert_eq!(lines[78..], ["", "all in order: 8 chips, 64 channels"]);
}

#[test]
fn what_is_wrong_stands_in_its_row_and_in_the_last_line() {
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
        "     11  FFC6            -100.00      -41.3          0.14            0.14  wrong gain",
        "     62  exg1              +1.23      -41.3          0.14            0.14  fault 9, newer than this bridge",
        "NOT IN ORDER: chip 1, channel 3: gain; 3 of 8 chips; 2 of 64 channels",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
}

#[test]
fn a_test_that_could_not_go_on_is_not_in_order() {
    let report = report(result(|test| {
        test.chips.truncate(1);
        test.channels.clear();
    }));
    assert!(!report.passed);
    assert_eq!(
        report.verdict,
        "NOT IN ORDER: 64 of 64 channels not measured"
    );
    assert!(!report.to_string().contains("electrode"));
}

#[test]
fn a_figure_that_was_not_measured_is_a_dash_and_in_json_null_and_never_in_order() {
    let report = report(result(|test| {
        // No DRDY, so no test; nothing but bad frames; levels of both kinds in too few samples; stopped
        // before the inputs were shorted; dead, and measured to be.
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
        "      1  F3                    -          -             -               -  not measured",
        "      2  F1                    -          -             -               -  too few samples",
        "      3  Fz                    -          -             -            0.14  too few samples",
        "      4  F2                +1.23      -41.3          0.14               -  not measured",
        "      5  F4              -100.00     -937.5          0.00            0.00  wrong gain",
        "NOT IN ORDER: 3 of 64 channels; 2 of 64 channels not measured",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    let json: serde_json::Value = serde_json::to_value(&report).unwrap();
    let first = &json["channels"][0];
    for figure in [
        "gain_error_percent",
        "offset_uv",
        "noise_uv",
        "shorted_noise_uv",
    ] {
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
fn refusals_say_why_and_what_to_do() {
    for (question, answer, expected) in [
        (
            Question::SelfTest,
            AckResult::UnknownCommand,
            "update the firmware",
        ),
        (Question::SelfTest, AckResult::NotSupported, "no converters"),
        (Question::SelfTest, AckResult::Busy, "end that program"),
        (
            Question::SelfTest,
            AckResult::Failed,
            "corticode-bridge reset",
        ),
        (Question::SelfTest, AckResult::Newer(77), "one release"),
        (
            Question::Reset(ResetInto::Bootloader),
            AckResult::NotSupported,
            "BOOT0",
        ),
        (
            Question::Reset(ResetInto::Firmware),
            AckResult::UnknownCommand,
            "update the firmware",
        ),
    ] {
        let error = refusal(question, answer);
        assert_eq!(error.exit_code(), 4, "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn a_device_that_says_nothing_is_given_up() {
    let mut desk = Desk::new(Question::SelfTest, Board::new());
    let silent = |desk: &mut Desk| {
        let mut us = 0;
        loop {
            us += 100_000;
            match desk.inquiry.tick(us) {
                Some(Err(error)) => return (us, error),
                Some(Ok(answer)) => panic!("{answer:?}"),
                None => drop(desk.inquiry.outgoing()),
            }
        }
    };
    let (us, error) = silent(&mut desk);
    assert_eq!((us, error.exit_code()), (5_100_000, 3));
    assert!(error.to_string().contains("who is there"), "{error}");
    // One that acknowledges and never finishes has 15 s.
    let mut desk = Desk::new(Question::SelfTest, Board::new());
    assert!(desk.talk(15_000_000).is_none());
    let outcome = desk.talk(1_000_000);
    let Some(Err(error)) = outcome else {
        panic!("{outcome:?}")
    };
    assert!(
        error.to_string().contains("the result of the self-test"),
        "{error}"
    );
}

#[test]
fn a_lost_acknowledgement_of_the_test_is_no_refusal() {
    let mut desk = Desk::new(Question::SelfTest, Board::new());
    while desk.asked().last() != Some(&ToDevice::SelfTest) {
        assert!(desk.inquiry.tick(desk.now_us).is_none());
        let answers = desk.board.answer(&desk.inquiry.outgoing());
        if desk.asked().last() != Some(&ToDevice::SelfTest) {
            assert!(desk.inquiry.receive(&answers, desk.now_us).is_none());
        }
        desk.now_us += 100_000;
    }
    // It is at it, so the repeated command is refused.
    desk.board.answers = AckResult::Busy;
    assert!(desk.talk(2_000_000).is_none());
    let outcome = desk.say(&ToHost::SelfTest(result(|_| {})));
    assert!(matches!(outcome, Some(Ok(Answer::SelfTest(_)))));
}

#[test]
fn a_device_that_was_reset_is_back_when_it_says_hello_in_another_session() {
    let mut desk = Desk::new(Question::Reset(ResetInto::Firmware), Board::new());
    assert!(desk.talk(2_000_000).is_none(), "it has not gone yet");
    assert!(desk.inquiry.may_lose_port());
    desk.board.reboot();
    desk.inquiry.connected(desk.now_us);
    let outcome = desk.talk(1_000_000);
    let Some(Ok(Answer::Back(device))) = outcome else {
        panic!("{outcome:?}")
    };
    assert_eq!(device.reset_cause, "power on");
}

#[test]
fn a_device_that_starts_anew_in_the_middle_of_its_test_says_why() {
    let mut desk = Desk::new(Question::SelfTest, Board::new());
    assert!(desk.talk(2_000_000).is_none());
    desk.board.reboot();
    let hello = desk.board.hello();
    let outcome = desk.inquiry.receive(&hello, desk.now_us);
    let Some(Err(error)) = outcome else {
        panic!("{outcome:?}")
    };
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().contains("started by power on"), "{error}");
}

#[test]
fn a_device_in_its_loader_is_not_waited_for() {
    let mut desk = Desk::new(Question::Reset(ResetInto::Bootloader), Board::new());
    let outcome = desk.talk(1_000_000);
    assert!(
        matches!(outcome, Some(Ok(Answer::InLoader(_)))),
        "{outcome:?}"
    );
    assert_eq!(
        desk.asked().last(),
        Some(&ToDevice::Reset(ResetInto::Bootloader))
    );
}

#[test]
fn noise_is_no_answer() {
    let mut desk = Desk::new(Question::SelfTest, Board::new());
    let noise: Vec<u8> = (0..50_000_u32)
        .map(|n| ((n * n) >> 3).to_le_bytes()[1])
        .collect();
    assert!(desk.inquiry.receive(&noise, 0).is_none());
    assert!(desk.talk(2_000_000).is_none());
    assert_eq!(desk.asked().last(), Some(&ToDevice::SelfTest));
}
