//! A board that hangs, panics or faults resets itself, reports the cause in its next `Hello`, and streams from the
//! start again.
#![forbid(unsafe_code)]

use emulated::board::{APPLICATION, boards};
use emulated::frames::Boot;
use emulated::host;
use emulated::input::Input;
use emulator::figures;
use link::{Code, ResetCause, Streams};
use model::{HOP, STEP_RATE_HZ, STEPS};
use serde::Serialize;
use serde_json::json;

const TEST: &str = "failures of the emulated application";

/// Argument that makes the image fail after a second, and what its next `Hello` must report.
const FAILURES: [(&str, ResetCause, &str); 3] = [
    ("hang", ResetCause::Watchdog, "watchdog"),
    ("panic", ResetCause::Fault, "asked to panic"),
    ("fault", ResetCause::Fault, "hard fault at 0x"),
];

/// Seconds of samples; the image reads them from the start again after its reset.
const SECONDS: usize = 3;

/// Codes of all samples.
const CODES: usize = 1 + (SECONDS * STEP_RATE_HZ as usize - STEPS) / HOP;

/// Figures of one failure.
#[derive(Debug, Serialize)]
struct Figures {
    asked: &'static str,
    /// Codes before the reset and after it.
    codes: Vec<usize>,
    /// Fault in the second `Hello`.
    said: String,
}

#[test]
fn a_board_that_fails_resets_itself_reports_why_and_streams_again() {
    let input = Input::from_environment();
    let samples = input.first_seconds(SECONDS);
    let expected = Boot::only(&host::sent(Streams::CODES, samples)).codes();
    assert_eq!(expected.len(), CODES);
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("failures", samples);
        let boots = FAILURES.map(|(word, ..)| {
            let run = scenario.run(&["start", word], &format!("{word}.uart"));
            Boot::split(&run.sent)
        });
        let figures = FAILURES.iter().zip(&boots).map(|((asked, ..), boots)| {
            let hellos = boots.iter().skip(1).flat_map(|boot| &boot.hellos);
            Figures {
                asked,
                codes: boots.iter().map(|boot| boot.timed_codes.len()).collect(),
                said: hellos.map(|hello| &hello.fault[..]).collect(),
            }
        });
        let figures: Vec<Figures> = figures.collect();
        figures::record(Some(board.machine.name), &json!({"failures": figures}));
        for ((word, cause, text), boots) in FAILURES.iter().zip(&boots) {
            println!("after `{word}`:");
            check(*cause, text, boots, &expected);
        }
    }
}

fn check(cause: ResetCause, text: &str, boots: &[Boot], expected: &[Code]) {
    let [before, after] = boots else {
        panic!("{} boots, 2 expected", boots.len());
    };
    let [hello] = &after.hellos[..] else {
        panic!("one Hello expected after the reset: {:?}", after.hellos);
    };
    assert!(
        hello.cause == cause && hello.fault.contains(text),
        "{cause:?} with `{text}` expected in {hello:?}"
    );
    let count = before.timed_codes.len();
    assert!(count > 0, "no code before the failure");
    before.assert_codes(&expected[..count.min(expected.len())]);
    // From the file's start, as if nothing had happened.
    after.assert_codes(expected);
}

#[test]
fn a_board_that_does_not_come_back_or_does_not_report_why_is_refused() {
    let input = Input::new(80);
    let boot = |seconds| Boot::only(&host::sent(Streams::CODES, input.first_seconds(seconds)));
    let expected = boot(SECONDS).codes();
    let refusal = |boots: &[Boot]| {
        emulated::refusal::message(|| check(ResetCause::Fault, "asked", boots, &expected))
    };
    let mut boots = [boot(1), boot(SECONDS)];
    boots[1].hellos[0].cause = ResetCause::Fault;
    boots[1].hellos[0].fault = "asked to panic".to_owned();
    assert_eq!(refusal(&boots), "");
    assert_eq!(refusal(&boots[..1]), "1 boots, 2 expected");
    let mut silent = boots.clone();
    silent[1].hellos[0].fault.clear();
    assert!(refusal(&silent).contains("Fault with `asked` expected"));
    let mut short = boots.clone();
    short[1].timed_codes.pop();
    assert!(refusal(&short).ends_with("46 of 47 codes"));
    let mut early = boots;
    early[0].timed_codes.clear();
    assert_eq!(refusal(&early), "no code before the failure");
}
