//! Description of a file to write, in any format.

use std::io;

/// One signal of a file to write.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalToWrite {
    /// Label, at most 16 bytes; the rest is cut off.
    pub label: String,
    /// Whether the values are microvolts; otherwise they have no unit.
    pub is_microvolt: bool,
    /// Whether the values are integers, of at most 24 bits with their sign.
    pub is_integer: bool,
    /// Smallest and largest value that is possible.
    pub range: [f64; 2],
}

/// What a file states about all its signals.
#[derive(Debug, Clone, PartialEq)]
pub struct FileToWrite {
    /// All signals, in the order of the values in a row.
    pub signals: Vec<SignalToWrite>,
    /// Rows per second, Hz.
    pub rate_hz: u32,
    /// Rows in a record.
    pub rows_per_record: u32,
    /// Wall clock at the first row, nanoseconds since 1970.
    pub start_ns: i64,
    /// Text that identifies the recording, such as the device's name.
    pub description: String,
}

impl FileToWrite {
    /// Checks what every format requires.
    ///
    /// # Errors
    /// `InvalidInput` without rows in a record or without a rate.
    pub(crate) fn check(&self) -> io::Result<()> {
        if self.rows_per_record == 0 || self.rate_hz == 0 {
            return Err(invalid("a record has rows, and a signal has a rate"));
        }
        Ok(())
    }
}

/// Returns the error of a file that its format cannot hold.
pub(crate) fn invalid(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}
