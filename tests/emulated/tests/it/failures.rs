//! Scenario with a board that hangs, panics or faults: it resets itself, reports the cause in its
//! next `Hello`, and streams from the start again.

use emulated::board::boards;
use emulated::compare::first_difference;
use emulated::frames::{self, Boot};
use emulated::input::Input;
use link::{ResetCause, Streams};
use model::{HOP, STEP_RATE_HZ, STEPS};
use serde_json::json;

/// For each failure, the argument that makes the image fail after a second, the reset cause that
/// the next `Hello` must report, and a part of the text of the fault that it must report.
const FAILURES: [(&str, ResetCause, &str); 3] = [
    ("hang", ResetCause::Watchdog, "watchdog"),
    ("panic", ResetCause::Fault, "asked to panic"),
    ("fault", ResetCause::Fault, "hard fault at 0x"),
];

/// Duration of the samples, seconds. After its reset, the image reads them from the start again.
const SECONDS: usize = 3;

/// Number of codes that a boot computes if it reads all samples.
const CODES: usize = 1 + (SECONDS * STEP_RATE_HZ as usize - STEPS) / HOP;

#[test]
fn a_board_that_fails_resets_itself_reports_why_and_streams_again() {
    let input = Input::from_environment();
    let samples = input.first_seconds(SECONDS);
    let expected = Boot::only(&frames::simulated(Streams::CODES, samples)).codes();
    assert_eq!(expected.len(), CODES);
    for board in boards("failures", samples) {
        let runs = FAILURES.map(|(asked, cause, fault)| {
            let run = board.run(&["start", asked], &format!("{asked}.uart"));
            (asked, cause, fault, Boot::split(&run.sent))
        });
        let figures = runs.each_ref().map(|(asked, _, _, boots)| {
            let codes: Vec<_> = boots.iter().map(|boot| boot.timed_codes.len()).collect();
            let hellos = boots.iter().skip(1).flat_map(|boot| &boot.hellos);
            let said: String = hellos.map(|(_, fault)| &fault[..]).collect();
            json!({"asked": asked, "codes": codes, "said": said})
        });
        board.record(&json!({"failures": figures}));
        for (asked, cause, fault, boots) in runs {
            println!("after `{asked}`:");
            let [before, after] = &boots[..] else {
                panic!("{} boots, 2 expected", boots.len());
            };
            let [(found, text)] = &after.hellos[..] else {
                panic!("one Hello expected after the reset: {:?}", after.hellos);
            };
            assert_eq!(*found, cause, "cause in Hello: {text:?}");
            assert!(text.contains(fault), "`{fault}` expected in {text:?}");
            let [before, after] = [before.codes(), after.codes()];
            assert!(!before.is_empty(), "no code before the failure");
            let until_failure = &expected[..before.len().min(CODES)];
            for (expected, codes) in [(until_failure, before), (&expected, after)] {
                let difference = first_difference(expected, &codes);
                assert_eq!(difference, None, "a code is not host-sim's");
            }
        }
    }
}
