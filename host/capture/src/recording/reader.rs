//! Reads recordings, even damaged ones.

use std::io::{ErrorKind, Read, Seek, SeekFrom};

use bridge_core::HostTime;

use crate::recording::{FileHeader, MAX_RECORD, Parsed, Record, RecordingError};

/// Number of bytes requested by one read from the file.
const BLOCK: usize = 64 * 1024;

/// Limit of the host's monotonic clock, microseconds: 285 years. Up to this limit a float64 is
/// exact. A later time counts as damage.
const MAX_MONOTONIC_US: i64 = 1 << 53;
/// Limit of the wall clock, nanoseconds since 1970: the year 2116. A later time counts as damage.
const MAX_WALL_NS: i64 = 1 << 62;
/// Longest possible time from one record to the next, microseconds: 366 days.
const MAX_PAUSE_US: i64 = 366 * 86_400 * 1_000_000;
/// Largest possible step back in time from one record to the next, microseconds.
const MAX_STEP_BACK_US: i64 = 10_000_000;

/// Reads the records of a recording one by one. Damage costs only the records that it hits, because
/// the reader continues at the next whole one. A record with an impossible time counts as damaged.
#[derive(Debug)]
pub struct RecordingReader<R> {
    source: R,
    header: FileHeader,
    /// Bytes from the file. The bytes before `position` have been used.
    buffer: Vec<u8>,
    position: usize,
    at_end: bool,
    left_out: LeftOut,
    /// Number of bytes since the last whole record that are not part of a record.
    damaged: u64,
    /// Time of the newest record.
    newest: Option<HostTime>,
}

/// Numbers of bytes in a file that are not part of a whole record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Number of bytes between whole records.
    pub within: u64,
    /// Number of bytes after the last whole record.
    pub at_end: u64,
}

impl<R: Read> RecordingReader<R> {
    /// Creates a reader of `source` and reads the header of the recording.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if the file is not a recording that this program can read.
    pub fn new(mut source: R) -> Result<RecordingReader<R>, RecordingError> {
        let mut header = Vec::new();
        let limit = FileHeader::BYTES as u64;
        source.by_ref().take(limit).read_to_end(&mut header)?;
        Ok(RecordingReader {
            header: FileHeader::decode(&header)?,
            source,
            buffer: Vec::new(),
            position: 0,
            at_end: false,
            left_out: LeftOut::default(),
            damaged: 0,
            newest: None,
        })
    }

    /// Returns the file's header.
    pub fn header(&self) -> &FileHeader {
        &self.header
    }

    /// Returns how many of the bytes read so far are not part of a whole record.
    pub fn left_out(&self) -> LeftOut {
        self.left_out
    }

    /// Returns the next whole record; `None` at the end of the file.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Read`] if the operating system cannot read the file.
    pub fn next_record(&mut self) -> Result<Option<Record<'_>>, RecordingError> {
        let length = loop {
            self.fill(MAX_RECORD)?;
            let bytes = &self.buffer[self.position..];
            match Record::parse(bytes) {
                Parsed::Whole(record, length) if is_possible(record.time, self.newest) => {
                    self.newest = Some(record.time);
                    break length;
                }
                _ if bytes.is_empty() => {
                    self.left_out.at_end += std::mem::take(&mut self.damaged);
                    return Ok(None);
                }
                Parsed::Whole(..) | Parsed::Incomplete | Parsed::Damaged => {
                    self.position += 1;
                    self.damaged += 1;
                }
            }
        };
        self.left_out.within += std::mem::take(&mut self.damaged);
        let start = self.position;
        self.position += length;
        match Record::parse(&self.buffer[start..self.position]) {
            Parsed::Whole(record, _) => Ok(Some(record)),
            // Unreachable: the same bytes were a whole record in the loop above.
            Parsed::Incomplete | Parsed::Damaged => Ok(None),
        }
    }

    /// Reads from the file until the buffer has `needed` bytes that are not parsed yet, or the file
    /// ends.
    fn fill(&mut self, needed: usize) -> Result<(), RecordingError> {
        if self.at_end || self.buffer.len() - self.position >= needed {
            return Ok(());
        }
        self.buffer.drain(..self.position);
        self.position = 0;
        while self.buffer.len() < needed {
            let before = self.buffer.len();
            self.buffer.resize(before + BLOCK, 0);
            let read = self.source.read(&mut self.buffer[before..]);
            self.buffer.truncate(before + read.as_ref().map_or(0, |count| *count));
            match read {
                Ok(0) => {
                    self.at_end = true;
                    break;
                }
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

impl<R: Read + Seek> RecordingReader<R> {
    /// Goes back to the first record, and sets all counts to 0.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Read`] if the operating system cannot do so.
    pub(crate) fn rewind(&mut self) -> Result<(), RecordingError> {
        self.source.seek(SeekFrom::Start(FileHeader::BYTES as u64))?;
        self.buffer.clear();
        self.position = 0;
        self.at_end = false;
        self.left_out = LeftOut::default();
        self.damaged = 0;
        self.newest = None;
        Ok(())
    }
}

/// Returns whether a record can have the time `time` if the record before it has `before`.
fn is_possible(time: HostTime, before: Option<HostTime>) -> bool {
    let before_us = before.map_or(time.monotonic_us, |before| before.monotonic_us);
    let step_us = time.monotonic_us.saturating_sub(before_us);
    (0..MAX_MONOTONIC_US).contains(&time.monotonic_us)
        && (0..MAX_WALL_NS).contains(&time.wall_ns)
        && (-MAX_STEP_BACK_US..=MAX_PAUSE_US).contains(&step_us)
}
