//! Bytes that the image receives at set device times, from a file instead of its UART.

use link::{Ack, AckResult, Decoder, MAX_FRAME, Message, Start, Streams, ToDevice, VERSION};

use crate::frames::frame;

/// File of the script in the image's folder. Each entry has the device time in microseconds (64 bits), the boot,
/// counted from 1, and the length (32 bits each), all little endian, followed by the bytes.
pub const FILE: &str = "commands.bin";

/// Bytes for the board, and the answers that it must send.
#[derive(Debug, Default)]
pub struct Script {
    /// Contents of [`FILE`].
    pub file: Vec<u8>,
    /// Expected answers to the commands, in order.
    pub answers: Vec<Ack>,
    /// All bytes for the board, in order, without their times.
    bytes: Vec<u8>,
    /// Frame of the last command, and its answer.
    last: Option<(Vec<u8>, Ack)>,
    next_seq: u32,
}

/// The command that starts these streams with a mains frequency in Hz, 50 or 60, or 0 for the board's default.
pub const fn start(streams: Streams, mains_hz: u8) -> ToDevice {
    ToDevice::Start(Start { streams, mains_hz })
}

impl Script {
    /// Adds bytes that the board receives at this device time of this boot, which is counted from 1. Times must
    /// not decrease from call to call.
    ///
    /// # Panics
    /// When there are 4 GiB or more.
    pub fn add_bytes(&mut self, boot: u32, at_us: u64, bytes: &[u8]) {
        let length = u32::try_from(bytes.len()).expect("less than 4 GiB");
        self.file.extend(at_us.to_le_bytes());
        self.file.extend(boot.to_le_bytes());
        self.file.extend(length.to_le_bytes());
        self.file.extend(bytes);
        self.bytes.extend(bytes);
    }

    /// Adds a command, and `result` as its expected answer.
    pub fn add_command<'m>(
        &mut self,
        boot: u32,
        at_us: u64,
        command: &impl Message<'m>,
        result: AckResult,
    ) {
        let of = self.next_seq;
        self.next_seq += 1;
        self.last = Some((frame(of, VERSION, command), Ack { of, result }));
        self.repeat_command(boot, at_us);
    }

    /// Repeats the last command, as a host does that has not received the answer.
    pub fn repeat_command(&mut self, boot: u32, at_us: u64) {
        if let Some((bytes, answer)) = self.last.clone() {
            self.add_bytes(boot, at_us, &bytes);
            self.answers.push(answer);
        }
    }

    /// Number of commands that a board decodes from the bytes, and number of frames that it cannot use.
    pub fn decodable_and_unusable(&self) -> (u32, u32) {
        let mut bytes = &self.bytes[..];
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let (mut decodable, mut unusable) = (0, 0);
        while let Some(outcome) = decoder.next::<ToDevice>(&mut bytes) {
            match outcome {
                Ok(_) => decodable += 1,
                Err(_) => unusable += 1,
            }
        }
        (decodable, unusable)
    }
}
