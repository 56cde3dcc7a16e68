//! A host that sends a hundred commands a second and garbage in between costs the stream nothing, and each command
//! is answered.
#![forbid(unsafe_code)]

use emulated::board::{APPLICATION, Run, boards};
use emulated::compare::{count_differences, first_difference};
use emulated::frames::{self, Boot};
use emulated::host;
use emulated::input::Input;
use emulated::script::{self, Script};
use emulated::stages::{self, Stages};
use emulated::storm::{self, PERIOD_US};
use emulator::figures;
use link::{ClockReading, Streams, ToHost};
use model::ADC_RATE_HZ;
use serde::Serialize;
use serde_json::json;

const TEST: &str = "a storm of commands";

/// Duration of the storm in seconds of samples, for an input that is long enough.
const SECONDS: usize = 60;

/// Longest time in microseconds from a command to its reading by the board, which acquires samples first.
const READ_WITHIN_US: u64 = 5_000;

/// Figures of one machine.
#[derive(Debug, Serialize)]
struct Figures {
    seconds: usize,
    /// Commands that must be answered, repetitions included.
    commands: usize,
    /// Frames that must not be answered.
    unusable: u32,
    different_answers: usize,
    codes: usize,
    different_codes: usize,
    overruns: u64,
    repeatable: bool,
    stages: Stages,
}

#[test]
fn a_storm_of_commands_is_answered_and_costs_the_stream_nothing() {
    let input = Input::from_environment();
    let samples = input.first_seconds(SECONDS);
    let expected = Boot::only(&host::sent(Streams::CODES, samples));
    let script = storm::script(samples.len());
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("storm", samples);
        scenario.write(script::FILE, &script.file);
        let runs = scenario.run_twice(&["start", "commands"]);
        let boot = Boot::only(&runs[0].sent);
        let last = boot.last_stats();
        let figures = Figures {
            seconds: samples.len() / usize::from(ADC_RATE_HZ),
            commands: script.answers.len(),
            unusable: script.decodable_and_unusable().1,
            different_answers: count_differences(&script.answers, &boot.acks),
            codes: boot.timed_codes.len(),
            different_codes: count_differences(&expected.codes(), &boot.codes()),
            overruns: runs[0].printed("overruns").max(last.overruns.into()),
            repeatable: contents(&runs[0].sent) == contents(&runs[1].sent),
            stages: Stages::from_last(&boot.timing),
        };
        figures::record(Some(board.machine.name), &json!({"storm": figures}));
        check(&boot, &script, &expected);
        check_counters(&runs[0], &boot, &script, samples.len());
        assert!(figures.repeatable, "a second run has sent other frames");
        figures.stages.assert_within(stages::LIMIT_BUSY);
    }
}

/// Checks answers, codes and reports.
fn check(boot: &Boot, script: &Script, expected: &Boot) {
    let difference = first_difference(&script.answers, &boot.acks);
    assert_eq!(difference, None, "the first answer that is not expected");
    let late = boot.clock_readings.iter();
    let late: Vec<_> = late
        .filter(|(at_us, reading)| !is_prompt(*at_us, reading))
        .collect();
    assert!(
        late.is_empty(),
        "late clock readings, with their device times: {late:?}"
    );
    boot.assert_codes(&expected.codes());
    assert_eq!(
        count_differences(&expected.quality, &boot.quality),
        0,
        "reports on electrodes that are not host-sim's"
    );
    assert_eq!(boot.jitter_us(), 0, "jitter of the codes' times");
    boot.assert_whole();
}

/// Checks what the board has counted.
fn check_counters(run: &Run, boot: &Boot, script: &Script, samples: usize) {
    let last = boot.last_stats();
    assert_eq!(run.printed("samples"), samples as u64, "samples");
    assert_eq!(run.printed("overruns"), 0, "overruns");
    assert_eq!(last.overruns, 0, "overruns in Stats");
    assert_eq!(
        (last.commands, last.input_bad),
        script.decodable_and_unusable(),
        "commands, and frames that are unusable"
    );
}

/// Whether the clock was read soon after the host has asked, and sent afterwards. The host's clock is the board's
/// here; each repetition of a command comes [`PERIOD_US`] later.
fn is_prompt(device_us: u64, reading: &ClockReading) -> bool {
    let waited = reading.received_us.checked_sub(reading.host_time_us);
    waited.is_some_and(|waited| waited % PERIOD_US <= READ_WITHIN_US)
        && device_us >= reading.received_us
}

/// The messages of all frames, without measured times.
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

/// Why a board is refused that answers as expected and sends host-sim's codes, after `change`.
fn refusal(change: impl Fn(&mut Boot)) -> String {
    let samples = Input::new(60).samples;
    let script = storm::script(samples.len());
    let expected = Boot::only(&host::sent(Streams::CODES, &samples));
    let mut boot = expected.clone();
    boot.acks.clone_from(&script.answers);
    change(&mut boot);
    emulated::refusal::message(|| check(&boot, &script, &expected))
}

#[test]
fn an_answer_too_few_too_many_or_of_another_kind_is_refused() {
    assert_eq!(refusal(|_| ()), "");
    let few = refusal(|boot| boot.acks.truncate(200));
    assert!(few.contains("200 of "), "{few}");
    let twice = refusal(|boot| boot.acks.insert(9, boot.acks[9]));
    assert!(twice.contains("10: Ack"), "{twice}");
    let wrong = refusal(|boot| boot.acks[40].result = link::AckResult::Failed);
    assert!(
        wrong.contains("40: Ack") && wrong.contains("Failed"),
        "{wrong}"
    );
    let code = refusal(|boot| boot.timed_codes[5].1.window += 1);
    assert!(code.starts_with("the codes are not host-sim's"), "{code}");
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
    let late = refusal(|boot| boot.clock_readings.push((58_000, reading(57_000))));
    assert!(late.contains("clock readings"), "{late}");
}
