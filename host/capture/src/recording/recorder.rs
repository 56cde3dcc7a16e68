//! Conversion of what happens at a port to the bytes of a recording.

use crate::recording::file_header::FileHeader;
use crate::recording::record::{Record, RecordKind};
use crate::recording::splitter::Splitter;
use bridge_core::HostTime;

/// Converts what happens at a port to records. Pure: the caller writes [`Recorder::take`]'s bytes
/// to a file.
#[derive(Debug)]
pub struct Recorder {
    splitter: Splitter,
    unwritten: Vec<u8>,
    bytes: u64,
}

impl Recorder {
    /// Creates a recorder whose first bytes are the file's header.
    pub fn new(header: FileHeader) -> Recorder {
        Recorder {
            splitter: Splitter::default(),
            unwritten: header.encode().to_vec(),
            bytes: FileHeader::BYTES as u64,
        }
    }

    /// Records that the port was opened.
    pub fn opened(&mut self, now: HostTime) {
        self.append(RecordKind::Opened, now, &[]);
    }

    /// Records that the port was closed or lost, after the bytes of an unfinished frame.
    pub fn closed(&mut self, now: HostTime) {
        self.finish_piece(now);
        self.append(RecordKind::Closed, now, &[]);
    }

    /// Records bytes from the device that were read at `read`. A frame is recorded when its last
    /// byte arrives, with the time of that.
    pub fn received(&mut self, bytes: &[u8], read: HostTime) {
        let mut splitter = std::mem::take(&mut self.splitter);
        splitter.push(bytes, |piece| {
            self.append(RecordKind::Received, read, piece);
        });
        self.splitter = splitter;
    }

    /// Records a command to the device.
    pub fn sent(&mut self, frame: &[u8], now: HostTime) {
        self.append(RecordKind::Sent, now, frame);
    }

    /// Records that the user ended the recording.
    pub fn ending(&mut self, now: HostTime) {
        self.append(RecordKind::Ending, now, &[]);
    }

    /// Records the bytes of an unfinished frame.
    pub fn finish_piece(&mut self, now: HostTime) {
        let mut splitter = std::mem::take(&mut self.splitter);
        splitter.finish(|piece| self.append(RecordKind::Received, now, piece));
        self.splitter = splitter;
    }

    /// Returns the bytes that were recorded since the last call: whole records, and before them the
    /// header.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.unwritten)
    }

    /// Number of bytes recorded so far, the header included.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    fn append(&mut self, kind: RecordKind, time: HostTime, payload: &[u8]) {
        let before = self.unwritten.len();
        let record = Record {
            kind,
            time,
            payload,
        };
        record.encode(&mut self.unwritten);
        self.bytes += (self.unwritten.len() - before) as u64;
    }
}
