//! A board that hangs, panics or faults resets itself, reports the cause in its next `Hello`, and streams from the
//! start again.
#![forbid(unsafe_code)]

use emulated::board::{APPLICATION, boards};
use emulated::compare::first_different_code;
use emulated::frames::Boot;
use emulated::host;
use emulated::input::Input;
use link::{Code, ResetCause, Streams};
use model::{HOP, STEP_RATE_HZ, STEPS};
use serde_json::json;

const TEST: &str = "failures of the emulated application";

/// For each failure: the argument that makes the image fail after a second, and the reset cause and
/// a part of the fault in its next `Hello`.
const FAILURES: [(&str, ResetCause, &str); 3] = [
    ("hang", ResetCause::Watchdog, "watchdog"),
    ("panic", ResetCause::Fault, "asked to panic"),
    ("fault", ResetCause::Fault, "hard fault at 0x"),
];

/// Duration of the samples in seconds; the image reads them from the start again after its reset.
const SECONDS: usize = 3;

/// Number of codes computed from all samples.
const CODES: usize = 1 + (SECONDS * STEP_RATE_HZ as usize - STEPS) / HOP;

#[test]
fn a_board_that_fails_resets_itself_reports_why_and_streams_again() {
    let input = Input::from_environment();
    let samples = input.first_seconds(SECONDS);
    let expected = Boot::only(&host::sent(Streams::CODES, samples)).codes();
    assert_eq!(expected.len(), CODES);
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("failures", samples);
        let runs = FAILURES.map(|(asked, cause, fault)| {
            let run = scenario.run(&["start", asked], &format!("{asked}.uart"));
            (asked, cause, fault, Boot::split(&run.sent))
        });
        let figures = runs.each_ref().map(|(asked, _, _, boots)| {
            let codes: Vec<_> = boots.iter().map(|boot| boot.timed_codes.len()).collect();
            let hellos = boots.iter().skip(1).flat_map(|boot| &boot.hellos);
            let said: String = hellos.map(|hello| &hello.fault[..]).collect();
            json!({"asked": asked, "codes": codes, "said": said})
        });
        board.record(&json!({"failures": figures}));
        for (asked, cause, fault, boots) in runs {
            println!("after `{asked}`:");
            check(cause, fault, &boots, &expected);
        }
    }
}

fn check(cause: ResetCause, fault: &str, boots: &[Boot], expected: &[Code]) {
    let [before, after] = boots else {
        panic!("{} boots, 2 expected", boots.len());
    };
    let [hello] = &after.hellos[..] else {
        panic!("one Hello expected after the reset: {:?}", after.hellos);
    };
    assert!(
        hello.cause == cause && hello.fault.contains(fault),
        "{cause:?} with `{fault}` expected in {hello:?}"
    );
    let count = before.timed_codes.len();
    assert!(count > 0, "no code before the failure");
    let until_failure = &expected[..count.min(expected.len())];
    // The image reads the file from its start after the reset.
    for (expected, boot) in [(until_failure, before), (expected, after)] {
        let difference = first_different_code(expected, &boot.codes());
        assert_eq!(difference, None, "codes that are not host-sim's");
    }
}

#[test]
fn a_board_that_does_not_come_back_or_does_not_report_why_is_refused() {
    let input = Input::new(80);
    let boot = |seconds| Boot::only(&host::sent(Streams::CODES, input.first_seconds(seconds)));
    let expected = boot(SECONDS).codes();
    let check = |boots: &[Boot]| check(ResetCause::Fault, "asked", boots, &expected);
    let mut boots = [boot(1), boot(SECONDS)];
    boots[1].hellos[0].cause = ResetCause::Fault;
    boots[1].hellos[0].fault = "asked to panic".to_owned();
    check(&boots);
    let refuses = |words, change: &dyn Fn(&mut Vec<Boot>)| {
        let mut boots = boots.to_vec();
        change(&mut boots);
        emulated::refusal::assert_refused(words, || check(&boots));
    };
    refuses("1 boots, 2 expected", &|boots| boots.truncate(1));
    refuses("Fault with `asked` expected", &|boots| {
        boots[1].hellos[0].fault.clear();
    });
    refuses("46 of 47 codes", &|boots| boots[1].timed_codes.truncate(46));
    refuses("no code before the failure", &|boots| {
        boots[0].timed_codes.clear();
    });
}
