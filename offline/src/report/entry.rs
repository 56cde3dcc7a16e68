//! One recording of a report.

use crate::decoding::Decoded;

/// A decoded recording, with its name in the report.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Name, such as "S001/S001R11": the folder of its pictures within that of the report.
    pub name: String,
    /// Result of decoding it.
    pub decoded: Decoded,
}
