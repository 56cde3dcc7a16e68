//! Scenario with a host that sends a hundred commands a second, with garbage in between: the board
//! replies to each command, and the stream loses nothing.

use emulated::board::boards;
use emulated::compare::{count_differences, first_difference};
use emulated::frames::{self, Boot};
use emulated::input::Input;
use emulated::script::{self, Script, start};
use emulated::stages;
use link::{Ack, AckResult, ClockReading, Message, ResetInto, Streams, ToDevice, ToHost, VERSION};
use model::ADC_RATE_HZ;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Duration of the scenario in seconds of input; a shorter input is used as a whole.
const SECONDS: usize = 20;

/// Time limit for the board to read a command after its arrival, microseconds. Acquiring samples
/// has priority over reading commands.
const READ_WITHIN_US: u64 = 5_000;

#[test]
fn a_storm_of_commands_is_answered_and_the_stream_loses_nothing() {
    let input = Input::from_environment();
    let samples = input.first_seconds(SECONDS);
    let expected = Boot::only(&frames::simulated(Streams::CODES, samples));
    let script = storm(samples.len());
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

/// Returns whether the board read the command `SyncTime` within [`READ_WITHIN_US`] of its arrival,
/// and replied after that. The script puts the command's device time into the field for the host's
/// time; repetitions of the command arrive multiples of [`PERIOD_US`] later.
fn is_prompt(device_us: u64, reading: &ClockReading) -> bool {
    let waited = reading.received_us.checked_sub(reading.host_time_us);
    waited.is_some_and(|waited| waited % PERIOD_US <= READ_WITHIN_US)
        && device_us >= reading.received_us
}

/// Returns all messages except `Timing`, with `received_us` set to 0: these times vary between
/// runs.
fn contents(sent: &[u8]) -> Vec<Vec<u8>> {
    frames::filter_map(sent, |_, message| match message {
        ToHost::Timing(_) => None,
        ToHost::ClockReading(reading) => {
            Some(frames::encoded(&ToHost::ClockReading(ClockReading { received_us: 0, ..reading })))
        }
        message => Some(frames::encoded(&message)),
    })
}

/// Time from one command of the script to the next, microseconds.
const PERIOD_US: u64 = 10_000;
/// Time from a command to the garbage that may follow it, microseconds.
const GARBAGE_US: u64 = 5_000;
/// Time without commands at the end of the samples, microseconds, so that the last counters include
/// every command.
const SILENCE_US: u64 = 1_500_000;

/// A command of a kind that no board knows.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Unknown(u32);

impl Message<'_> for Unknown {
    const KINDS: u32 = u32::MAX;
    const DIRECTION: u8 = ToDevice::DIRECTION;
}

/// Returns a script with a hundred commands a second for the duration of `samples` samples: random
/// commands that do not end the stream, wrong arguments, repetitions and garbage. It is the same in
/// every run.
fn storm(samples: usize) -> Script {
    let mut random = ChaCha8Rng::seed_from_u64(13);
    let mut script = Script::default();
    let end_us = samples as u64 * 1_000_000 / u64::from(ADC_RATE_HZ);
    let mut at_us = 50_000;
    while at_us + SILENCE_US < end_us {
        add_command(&mut script, at_us, &mut random);
        if random.random_ratio(1, 3) {
            add_garbage(&mut script, at_us + GARBAGE_US, &mut random);
        }
        at_us += PERIOD_US;
    }
    script
}

fn add_command(script: &mut Script, at_us: u64, random: &mut ChaCha8Rng) {
    let mut add = |command: ToDevice, result| script.add_command(1, at_us, &command, result);
    let (done, bad) = (AckResult::Done, AckResult::BadArgument);
    let not_here = AckResult::NotSupported;
    match random.random_range(0..20) {
        0 => add(ToDevice::Identify, done),
        1 => add(start(Streams::CODES, 0), done),
        2 => add(start(Streams::CODES, 50), done),
        3 => add(start(Streams::CODES, random.random_range(61..=255)), bad),
        4 => add(start(Streams::from_bits(1 | 1 << 9), 0), bad),
        5 => add(start(Streams::empty(), 0), bad),
        6 => add(ToDevice::SelfTest, not_here),
        7 => add(ToDevice::Reset(ResetInto::Bootloader), not_here),
        8 => add(ToDevice::Reset(ResetInto::Newer(9)), bad),
        9 => script.add_command(1, at_us, &Unknown(77), AckResult::UnknownCommand),
        10..=12 => script.repeat_command(1, at_us),
        13..=16 => add(ToDevice::SyncTime { host_time_us: at_us }, done),
        _ => add(ToDevice::Ping, done),
    }
}

/// Adds bytes that are no valid command, and a zero, which separates them from the next frame.
fn add_garbage(script: &mut Script, at_us: u64, random: &mut ChaCha8Rng) {
    let ping = frames::frame(7, VERSION, &ToDevice::Ping);
    let mut bytes = match random.random_range(0..6) {
        0 => {
            let length = random.random_range(1..200);
            (0..length).map(|_| random.random()).collect()
        }
        1 => {
            let mut damaged = ping;
            let bit = random.random_range(8..8 * (damaged.len() - 1));
            damaged[bit / 8] ^= 1 << (bit % 8);
            damaged
        }
        2 => ping[..random.random_range(1..ping.len() - 1)].to_vec(),
        // A reply, which only a board sends, as if the line echoed it to the board.
        3 => frames::encoded(&ToHost::Ack(Ack { of: 7, result: AckResult::Done })),
        4 => frames::frame(7, VERSION + 1, &ToDevice::Ping),
        _ => {
            // Send more bytes than any frame has, in parts that fit the UART's receive buffer.
            for piece in 0..5 {
                script.add_bytes(1, at_us + 800 * piece, &[0x55; 500]);
            }
            script.add_bytes(1, at_us + 4_000, &[0]);
            return;
        }
    };
    bytes.push(0);
    script.add_bytes(1, at_us, &bytes);
}
