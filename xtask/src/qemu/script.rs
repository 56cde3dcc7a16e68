//! What a host says at set times.

use std::fs;
use std::path::Path;

use link::{Ack, AckResult, Header, MAX_FRAME, Message, VERSION};

use crate::benchmark::cannot_write;
use crate::failure::Failure;

/// The file in QEMU's folder that the image reads.
const FILE: &str = "commands.bin";

/// Bytes that a host says, and the answers that it must get.
#[derive(Debug, Clone, Default)]
pub(super) struct Script {
    /// As the image reads them.
    file: Vec<u8>,
    /// All that is said in a run, in order.
    said: Vec<u8>,
    /// Answers, in order.
    pub(super) answers: Vec<Ack>,
    /// The last command, as a frame, and what comes of it.
    last: Option<(Vec<u8>, Ack)>,
    next_seq: u32,
}

impl Script {
    /// Says these bytes at this device time of this boot, which is counted from 1; the calls follow
    /// their times.
    pub(super) fn say(&mut self, boot: u32, at_us: u64, bytes: &[u8]) {
        let length = u32::try_from(bytes.len()).unwrap_or(0);
        self.file.extend(at_us.to_le_bytes());
        self.file.extend(boot.to_le_bytes());
        self.file.extend(length.to_le_bytes());
        self.file.extend(bytes);
        self.said.extend(bytes);
    }

    /// Gives a command, of which this must come.
    pub(super) fn command<'m>(
        &mut self,
        boot: u32,
        at_us: u64,
        command: &impl Message<'m>,
        result: AckResult,
    ) {
        let of = self.next_seq;
        self.next_seq += 1;
        let answer = Ack { of, result };
        let bytes = frame(of, VERSION, command);
        self.say(boot, at_us, &bytes);
        self.answers.push(answer);
        self.last = Some((bytes, answer));
    }

    /// Says the last command again, as a host does that has missed the answer.
    pub(super) fn repeat(&mut self, boot: u32, at_us: u64) {
        if let Some((bytes, answer)) = self.last.clone() {
            self.say(boot, at_us, &bytes);
            self.answers.push(answer);
        }
    }

    /// All that is said, in order.
    pub(super) fn said(&self) -> &[u8] {
        &self.said
    }

    /// Puts it where the image reads it.
    ///
    /// # Errors
    /// The folder is not writable.
    pub(super) fn put_into(&self, folder: &Path) -> Result<(), Failure> {
        let path = folder.join(FILE);
        fs::write(&path, &self.file).map_err(|error| cannot_write(&path, &error))
    }
}

/// A command's frame.
pub(super) fn frame<'m>(seq: u32, version: u8, command: &impl Message<'m>) -> Vec<u8> {
    let header = Header {
        version,
        seq,
        device_time_us: 0,
    };
    let mut buffer = [0; MAX_FRAME];
    let frame = link::encode(&header, command, &mut buffer);
    frame.map(<[u8]>::to_vec).unwrap_or_default()
}
