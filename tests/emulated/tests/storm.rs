//! A host that sends a hundred commands a second, and garbage in between: each command is answered, and the stream
//! loses nothing.
#![forbid(unsafe_code)]

use emulated::board::{APPLICATION, boards};
use emulated::compare::{count_differences, first_difference};
use emulated::frames::{self, Boot};
use emulated::host;
use emulated::input::Input;
use emulated::script::{self, Script};
use emulated::stages::{self, Stages};
use emulated::storm::{self, PERIOD_US};
use link::{AckResult, ClockReading, Streams, ToHost};
use model::ADC_RATE_HZ;
use serde_json::json;

const TEST: &str = "a storm of commands";

/// Length of the storm, in seconds of input; a shorter input ends it sooner.
const SECONDS: usize = 60;

/// Longest time from the arrival of a command to its reading in microseconds; acquiring samples has priority.
const READ_WITHIN_US: u64 = 5_000;

#[test]
fn a_storm_of_commands_is_answered_and_the_stream_loses_nothing() {
    let input = Input::from_environment();
    let samples = input.first_seconds(SECONDS);
    let expected = Boot::only(&host::sent(Streams::CODES, samples));
    let script = storm::script(samples.len());
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("storm", samples);
        scenario.write(script::FILE, &script.file);
        let runs = scenario.run_twice(&["start", "commands"]);
        let boot = Boot::only(&runs[0].sent);
        let (_, unusable) = script.decodable_and_unusable();
        let repeatable = contents(&runs[0].sent) == contents(&runs[1].sent);
        let stages = Stages::from_last(&boot.timing);
        let figures = json!({
            "seconds": samples.len() / usize::from(ADC_RATE_HZ),
            "commands": script.answers.len(),
            "unusable": unusable,
            "different_answers": count_differences(&script.answers, &boot.acks),
            "codes": boot.timed_codes.len(),
            "different_codes": count_differences(&expected.codes(), &boot.codes()),
            "overruns": runs[0].overruns(&boot),
            "repeatable": repeatable,
            "stages": stages,
        });
        board.record(&json!({"storm": figures}));
        check(&boot, &script, &expected);
        runs[0].assert_complete(&boot, samples.len());
        let last = boot.last_stats();
        assert_eq!(
            (last.commands, last.input_bad),
            script.decodable_and_unusable(),
            "commands, and frames that are unusable"
        );
        assert!(repeatable, "a second run has sent other frames");
        stages.assert_within(stages::LIMIT_BUSY);
    }
}

/// Checks answers, codes, reports and times.
fn check(boot: &Boot, script: &Script, expected: &Boot) {
    let difference = first_difference(&script.answers, &boot.acks);
    assert_eq!(difference, None, "the first unexpected answer");
    for (at_us, reading) in &boot.clock_readings {
        assert!(is_prompt(*at_us, reading), "at {at_us} us: {reading:?}");
    }
    boot.assert_equal_outputs(expected);
    assert_eq!(boot.jitter_us(), 0, "jitter of the codes' times");
}

/// Returns whether the board has read its clock soon after the command arrived, and sent the
/// reading afterwards. The script's host uses the board's clock, and repeats a command after a
/// multiple of [`PERIOD_US`].
fn is_prompt(device_us: u64, reading: &ClockReading) -> bool {
    let waited = reading.received_us.checked_sub(reading.host_time_us);
    waited.is_some_and(|waited| waited % PERIOD_US <= READ_WITHIN_US)
        && device_us >= reading.received_us
}

/// Returns the messages of all frames, without measured times.
fn contents(sent: &[u8]) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    frames::for_each(sent, |_, message| match message {
        ToHost::Timing(_) => {}
        ToHost::ClockReading(reading) => {
            all.push(frames::encoded(&ToHost::ClockReading(ClockReading {
                received_us: 0,
                ..*reading
            })));
        }
        message => all.push(frames::encoded(message)),
    });
    all
}

/// Checks a board that answers as expected and sends host-sim's codes, after `change`.
fn check_changed(change: impl Fn(&mut Boot)) {
    let samples = Input::new(60).samples;
    let script = storm::script(samples.len());
    let expected = Boot::only(&host::sent(Streams::CODES, &samples));
    let mut boot = expected.clone();
    boot.acks.clone_from(&script.answers);
    change(&mut boot);
    check(&boot, &script, &expected);
}

fn assert_refused(words: &str, change: impl Fn(&mut Boot)) {
    emulated::refusal::assert_refused(words, || check_changed(change));
}

#[test]
fn an_answer_too_few_too_many_or_of_another_kind_is_refused() {
    check_changed(|_| ());
    assert_refused("200 of ", |boot| boot.acks.truncate(200));
    assert_refused("10: Ack", |boot| boot.acks.insert(9, boot.acks[9]));
    assert_refused("40: Ack", |boot| boot.acks[40].result = AckResult::Failed);
    assert_refused("not host-sim's", |boot| boot.timed_codes[5].1.window += 1);
}

#[test]
fn a_clock_that_is_read_late_is_refused() {
    let reading = |received_us| ClockReading {
        host_time_us: 50_000,
        received_us,
    };
    assert!(is_prompt(50_300, &reading(50_200)));
    assert!(is_prompt(60_300, &reading(60_200)));
    assert!(!is_prompt(50_100, &reading(50_200)));
    assert!(!is_prompt(58_000, &reading(57_000)));
    assert!(!is_prompt(58_000, &reading(49_000)));
    assert_refused("at 58000 us: ClockReading", |boot| {
        boot.clock_readings.push((58_000, reading(57_000)));
    });
}
