//! Errors of reading a recording.

use std::io;

use thiserror::Error;

/// Reason why a file cannot be read as a recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file does not start as a recording does.
    #[error(
        "it is not a recording of corticode-bridge: it starts with \"{found}\"; name a file that \
         `corticode-bridge record` has written"
    )]
    NotARecording {
        /// First bytes of the file, escaped.
        found: String,
    },
    /// The file ends before its header does.
    #[error(
        "it holds only {bytes} bytes, less than the header of a recording; `corticode-bridge \
         record` was ended before it could write anything"
    )]
    HeaderCutOff {
        /// Length of the file, bytes.
        bytes: usize,
    },
    /// The header's checksum does not match.
    #[error("its header is damaged (CRC); copy the file again from where it was recorded")]
    HeaderDamaged,
    /// The file has a newer format than this program.
    #[error(
        "it has version {found} of the recording's format, and this program reads versions up \
         to {newest}; update corticode-bridge"
    )]
    Version {
        /// Version in the file.
        found: u16,
        /// Newest version that this program reads.
        newest: u16,
    },
    /// The file holds no code or sample of a device that introduced itself.
    #[error(
        "it holds no codes or samples of a device; record again, and check that the device answers"
    )]
    NoDevice,
    /// The file holds nothing that this program can publish.
    #[error("nothing in it can be converted: {objection}")]
    NothingUsable {
        /// Why, and what to do.
        objection: String,
    },
    /// The operating system cannot read the file.
    #[error("it cannot be read; check the path, the permissions and the disk")]
    Read(#[from] io::Error),
}
