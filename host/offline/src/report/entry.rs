//! One recording of a report.

use crate::comparison::Comparison;
use crate::decoding::Decoded;

/// A decoded recording, with its name in the report.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Name, such as "S001/S001R11": the folder of its pictures within that of the report.
    pub name: String,
    /// Result of decoding it.
    pub decoded: Decoded,
}

impl Entry {
    /// Returns the comparison with the original; `None` without one, and if no step could be compared.
    pub(super) fn compared(&self) -> Option<&Comparison> {
        let comparison = self.decoded.comparison.as_ref();
        comparison.filter(|comparison| comparison.steps > 0)
    }
}
