//! Where the bytes of a recording come from.

use std::io::{Read, Seek, SeekFrom};

use crate::RecordingError;

/// A place that recordings are read from.
pub trait Source: Read + Seek + Send {}
impl<T: Read + Seek + Send> Source for T {}

/// Files are read in blocks of about this many bytes; a longer record is a block of its own.
pub(crate) const BLOCK_BYTES: u64 = 64 * 1024;

/// Fills `bytes` from byte `at` on.
///
/// # Errors
/// [`RecordingError::Read`] when the source ends before or fails.
pub(crate) fn read_at(
    source: &mut dyn Source,
    at: u64,
    bytes: &mut [u8],
) -> Result<(), RecordingError> {
    let length = bytes.len() as u64;
    source
        .seek(SeekFrom::Start(at))
        .and_then(|_| source.read_exact(bytes))
        .map_err(|source| RecordingError::Read {
            at,
            bytes: length,
            source,
        })
}

/// A number of bytes that was checked against the size of the file; on a 32-bit machine a
/// larger one than memory can hold becomes an allocation that fails.
pub(crate) fn in_memory(bytes: u64) -> usize {
    usize::try_from(bytes).unwrap_or(usize::MAX)
}
