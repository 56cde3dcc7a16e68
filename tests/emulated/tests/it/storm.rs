//! A host that sends a hundred commands a second, and garbage in between: each command is answered,
//! and the stream loses nothing.

use emulated::board::boards;
use emulated::compare::{count_differences, first_difference};
use emulated::frames::{self, Boot};
use emulated::host;
use emulated::input::Input;
use emulated::script;
use emulated::stages;
use emulated::storm::{self, PERIOD_US};
use link::{ClockReading, Streams, ToHost};
use model::ADC_RATE_HZ;
use serde_json::json;

/// Duration of the storm in seconds of input, or the whole input if it is shorter.
const SECONDS: usize = 60;

/// Longest permitted time from the arrival of a command until the board reads it, in microseconds.
/// Acquiring samples has priority over reading commands.
const READ_WITHIN_US: u64 = 5_000;

#[test]
fn a_storm_of_commands_is_answered_and_the_stream_loses_nothing() {
    let input = Input::from_environment();
    let samples = input.first_seconds(SECONDS);
    let expected = Boot::only(&host::sent(Streams::CODES, samples));
    let script = storm::script(samples.len());
    let (decodable, unusable) = script.decodable_and_unusable();
    for board in boards("storm", samples) {
        board.write(script::FILE, &script.file);
        let [first, second] = board.run_twice(&["start", "commands"]);
        let boot = Boot::only(&first.sent);
        let last = boot.last_stats();
        let difference = first_difference(&contents(&first.sent), &contents(&second.sent));
        board.record(&json!({"storm": {
            "seconds": samples.len() / usize::from(ADC_RATE_HZ),
            "commands": script.answers.len(),
            "unusable": unusable,
            "different_answers": count_differences(&script.answers, &boot.acks),
            "codes": boot.timed_codes.len(),
            "different_codes": count_differences(&expected.codes(), &boot.codes()),
            "overruns": first.overruns(&boot),
            "repeatable": difference.is_none(),
            "stages": stages::figures(&boot.timing),
        }}));
        let answers = first_difference(&script.answers, &boot.acks);
        assert_eq!(answers, None, "the first unexpected answer");
        for (at_us, reading) in &boot.clock_readings {
            assert!(is_prompt(*at_us, reading), "at {at_us} us: {reading:?}");
        }
        boot.assert_equal_outputs(&expected);
        assert_eq!(boot.jitter_us(), 0, "jitter of the codes' times");
        first.assert_complete(&boot, samples.len());
        assert_eq!(last.commands, decodable, "commands");
        assert_eq!(last.input_bad, unusable, "frames that are unusable");
        assert_eq!(difference, None, "a second run has sent other frames");
        stages::assert_within(stages::LIMIT_BUSY, &boot.timing);
    }
}

/// Returns whether the board has read the command within [`READ_WITHIN_US`] of its arrival, and
/// sent the reading of its clock afterwards. The command states the device time at which the script
/// first sends it as the host's time; repetitions arrive multiples of [`PERIOD_US`] later.
fn is_prompt(device_us: u64, reading: &ClockReading) -> bool {
    let waited = reading.received_us.checked_sub(reading.host_time_us);
    waited.is_some_and(|waited| waited % PERIOD_US <= READ_WITHIN_US)
        && device_us >= reading.received_us
}

/// Returns the messages of all frames, without `Timing` and with `received_us` set to 0: measured
/// times vary.
fn contents(sent: &[u8]) -> Vec<Vec<u8>> {
    frames::filter_map(sent, |_, message| match message {
        ToHost::Timing(_) => None,
        ToHost::ClockReading(reading) => {
            Some(frames::encoded(&ToHost::ClockReading(ClockReading {
                received_us: 0,
                ..reading
            })))
        }
        message => Some(frames::encoded(&message)),
    })
}
