//! What a host says within a storm: a hundred commands a second, and garbage in between.

use link::{
    Ack, AckResult, Decoder, MAX_FRAME, Message, ResetInto, Start, Streams, ToDevice, ToHost,
    VERSION,
};
use model::ADC_RATE_HZ;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::super::frames;
use super::super::script::{self, Script};

/// From command to command, and from a command to the garbage behind it, microseconds.
pub(super) const EVERY_US: u64 = 10_000;
const GARBAGE_US: u64 = 5_000;
/// Before the end of the samples the host falls silent, so that the last counters tell of everything.
const SILENT_US: u64 = 1_500_000;

/// A command that no board knows.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Unknown(u32);

impl Message<'_> for Unknown {
    const KINDS: u32 = u32::MAX;
    const DIRECTION: u8 = ToDevice::DIRECTION;
}

/// A hundred commands a second for as long as the samples last: every one that there is but those that
/// end the stream, wrong arguments, repeated ones, and garbage in between. The same on every run.
pub(super) fn storm(samples: usize) -> Script {
    let mut random = ChaCha8Rng::seed_from_u64(13);
    let mut script = Script::default();
    let end_us = samples as u64 * 1_000_000 / u64::from(ADC_RATE_HZ);
    let mut at_us = 50_000;
    while at_us + SILENT_US < end_us {
        command(&mut script, at_us, &mut random);
        if random.random_ratio(1, 3) {
            garbage(&mut script, at_us + GARBAGE_US, &mut random);
        }
        at_us += EVERY_US;
    }
    script
}

fn start(streams: Streams, mains_hz: u8) -> ToDevice {
    ToDevice::Start(Start { streams, mains_hz })
}

fn command(script: &mut Script, at_us: u64, random: &mut ChaCha8Rng) {
    let mut give = |command: ToDevice, result| script.command(1, at_us, &command, result);
    let (done, bad) = (AckResult::Done, AckResult::BadArgument);
    let not_here = AckResult::NotSupported;
    match random.random_range(0..20) {
        0 => give(ToDevice::Identify, done),
        1 => give(start(Streams::CODES, 0), done),
        2 => give(start(Streams::CODES, 50), done),
        3 => give(start(Streams::CODES, random.random_range(61..=255)), bad),
        4 => give(start(Streams::from_bits(1 | 1 << 9), 0), bad),
        5 => give(start(Streams::empty(), 0), bad),
        6 => give(ToDevice::SelfTest, not_here),
        7 => give(ToDevice::Reset(ResetInto::Bootloader), not_here),
        8 => give(ToDevice::Reset(ResetInto::Newer(9)), bad),
        9 => script.command(1, at_us, &Unknown(77), AckResult::UnknownCommand),
        10..=12 => script.repeat(1, at_us),
        13..=16 => give(
            ToDevice::SyncTime {
                host_time_us: at_us,
            },
            done,
        ),
        _ => give(ToDevice::Ping, done),
    }
}

/// What is no command, and ends with a zero, as whatever comes before a sound frame.
fn garbage(script: &mut Script, at_us: u64, random: &mut ChaCha8Rng) {
    let ping = script::frame(7, VERSION, &ToDevice::Ping);
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
        // An echo.
        3 => frames::alone(&ToHost::Ack(Ack {
            of: 7,
            result: AckResult::Done,
        })),
        4 => script::frame(7, VERSION + 1, &ToDevice::Ping),
        _ => {
            // Longer than any frame, in pieces for which the port has room.
            for piece in 0..5 {
                script.say(1, at_us + 800 * piece, &[0x55; 500]);
            }
            script.say(1, at_us + 4_000, &[0]);
            return;
        }
    };
    bytes.push(0);
    script.say(1, at_us, &bytes);
}

/// How many sound commands a board reads in these bytes, and how many frames that are none.
pub(super) fn read_as_a_board(mut bytes: &[u8]) -> (u32, u32) {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let (mut sound, mut unusable) = (0, 0);
    while let Some(outcome) = decoder.next::<ToDevice>(&mut bytes) {
        match outcome {
            Ok(_) => sound += 1,
            Err(_) => unusable += 1,
        }
    }
    (sound, unusable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_storm_has_a_hundred_commands_a_second_and_garbage_that_costs_none_of_them() {
        let storm = storm(10 * usize::from(ADC_RATE_HZ));
        assert_eq!(storm.answers.len(), 845);
        let (sound, unusable) = read_as_a_board(storm.said());
        let unknown = |ack: &&Ack| ack.result == AckResult::UnknownCommand;
        let unknown = storm.answers.iter().filter(unknown).count();
        assert!(unknown > 10 && unusable as usize > 100 + unknown);
        assert_eq!(sound as usize + unknown, storm.answers.len());
    }
}
