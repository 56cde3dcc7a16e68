//! Detection of files that a transfer in text mode has damaged.

use crate::{
    error::RecordingError,
    source::{Source, in_memory, read_at},
};

/// Number of bytes that are searched from the start of the file.
const SEARCHED: u64 = 4 << 20;

/// Least number of line feeds that show anything. In an undamaged file a carriage return precedes a line
/// feed by chance once in 256 times, so four of four are damage.
const LEAST_LINE_FEEDS: usize = 4;

/// Returns whether a carriage return precedes every line feed of a file.
///
/// # Errors
/// [`RecordingError::Read`] if reading fails.
pub(crate) fn is_damaged(source: &mut dyn Source, file_bytes: u64) -> Result<bool, RecordingError> {
    let mut bytes = vec![0; in_memory(file_bytes.min(SEARCHED))];
    read_at(source, 0, &mut bytes)?;
    let line_feeds = bytes.split(|byte| *byte == b'\n').count() - 1;
    let after_return = bytes.windows(2).filter(|pair| *pair == b"\r\n").count();
    Ok(line_feeds >= LEAST_LINE_FEEDS && after_return == line_feeds)
}
