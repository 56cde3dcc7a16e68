//! Random access to the bytes of a recording, and detection of damage by a transfer in text mode.

use std::io::{Read, Seek, SeekFrom};

use crate::error::RecordingError;

/// A byte stream with random access, such as a file or a `Cursor` over bytes.
pub trait Source: Read + Seek + Send {}
impl<T: Read + Seek + Send> Source for T {}

/// Number of bytes that are read at once; a record that is longer is read as a whole.
pub(crate) const BLOCK_BYTES: u64 = 64 * 1024;

/// Fills `bytes` from the source, starting at byte offset `at`.
///
/// # Errors
/// [`RecordingError::Read`] if reading fails or the source ends before `bytes` is full.
pub(crate) fn read_at(
    source: &mut dyn Source,
    at: u64,
    bytes: &mut [u8],
) -> Result<(), RecordingError> {
    let length = bytes.len() as u64;
    source
        .seek(SeekFrom::Start(at))
        .and_then(|_| source.read_exact(bytes))
        .map_err(|source| RecordingError::Read { at, bytes: length, source })
}

/// Converts a number of bytes to `usize`. The caller must have checked the number against the size
/// of the file. On a 32-bit machine the conversion saturates, and the allocation then fails.
pub(crate) fn in_memory(bytes: u64) -> usize {
    usize::try_from(bytes).unwrap_or(usize::MAX)
}

/// Number of bytes at the start of a file that are searched for damage by a text-mode transfer.
const SEARCHED: u64 = 4 << 20;

/// Smallest number of line feeds that can prove damage by text mode. In an undamaged file, a
/// carriage return precedes a line feed by chance in one of 256 cases, so four of four mean damage.
const LEAST_LINE_FEEDS: usize = 4;

/// Returns whether a carriage return precedes every line feed in the first [`SEARCHED`] bytes of a
/// file, as after a transfer in text mode.
///
/// # Errors
/// [`RecordingError::Read`] if reading fails.
pub(crate) fn is_damaged_by_text_mode(
    source: &mut dyn Source,
    file_bytes: u64,
) -> Result<bool, RecordingError> {
    let mut bytes = vec![0; in_memory(file_bytes.min(SEARCHED))];
    read_at(source, 0, &mut bytes)?;
    let line_feeds = bytes.split(|byte| *byte == b'\n').count() - 1;
    let after_return = bytes.windows(2).filter(|pair| *pair == b"\r\n").count();
    Ok(line_feeds >= LEAST_LINE_FEEDS && after_return == line_feeds)
}
