//! Script of bytes that the image receives at set device times, from a file instead of the UART.

use link::{Ack, AckResult, Decoder, MAX_FRAME, Message, Start, Streams, ToDevice, VERSION};

use crate::frames::frame;

/// Name of the script in the image's folder. Each entry has four fields, all integers little
/// endian: device time in microseconds (64 bits), number of the boot, counted from 1 (32 bits),
/// number of bytes (32 bits), and the bytes.
pub const FILE: &str = "commands.bin";

/// Bytes that the board receives, and the answers that it must send.
#[derive(Debug, Default)]
pub struct Script {
    /// Contents of the file [`FILE`].
    pub file: Vec<u8>,
    /// Answers that the board must send to the commands, in order.
    pub answers: Vec<Ack>,
    /// All bytes that the board receives, in order, without their times.
    bytes: Vec<u8>,
    /// Frame of the last command, and its expected answer, for a repetition.
    last: Option<(Vec<u8>, Ack)>,
    next_seq: u32,
}

/// Returns the command that starts `streams`. `mains_hz` is 50, 60, or 0 for the board's default.
pub const fn start(streams: Streams, mains_hz: u8) -> ToDevice<'static> {
    ToDevice::Start(Start { streams, mains_hz })
}

impl Script {
    /// Adds bytes that the board receives in boot number `boot`, counted from 1, at the device time
    /// `at_us`. Times must not decrease from call to call.
    ///
    /// # Panics
    /// When `bytes` has 4 GiB or more.
    pub fn add_bytes(&mut self, boot: u32, at_us: u64, bytes: &[u8]) {
        let length = u32::try_from(bytes.len()).expect("less than 4 GiB");
        self.file.extend(at_us.to_le_bytes());
        self.file.extend(boot.to_le_bytes());
        self.file.extend(length.to_le_bytes());
        self.file.extend(bytes);
        self.bytes.extend(bytes);
    }

    /// Adds a command, to which the board must answer with `result`.
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

    /// Adds the last command again, like a host that has received no reply.
    pub fn repeat_command(&mut self, boot: u32, at_us: u64) {
        if let Some((bytes, answer)) = self.last.clone() {
            self.add_bytes(boot, at_us, &bytes);
            self.answers.push(answer);
        }
    }

    /// Returns the numbers of commands that a board can decode, and of frames that are unusable.
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
