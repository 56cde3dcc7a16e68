//! Error type with a snapshot of the board at the time of the failure.

use std::fmt;

/// Largest number of lines that a section of a snapshot shows: the last ones.
const LINES: usize = 16;

/// An error of a board, with a snapshot of the board at the time of the error.
#[derive(Clone, thiserror::Error)]
#[error("{what}\n{snapshot}")]
pub struct BoardError {
    what: String,
    snapshot: String,
}

impl BoardError {
    pub(crate) fn new(what: String, snapshot: String) -> Self {
        Self { what, snapshot }
    }
}

// `Debug` prints the same text as `Display`, because a test that returns this error prints it with
// `Debug`.
impl fmt::Debug for BoardError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{self}")
    }
}

/// Formats a section of a snapshot: a title and a line for each of `lines`; empty without lines.
pub(crate) fn section(title: &str, lines: &[String]) -> String {
    let last = &lines[lines.len().saturating_sub(LINES)..];
    let title = (!last.is_empty()).then(|| format!("  {title}:\n"));
    let lines = last.iter().map(|line| format!("    {line}\n"));
    title.into_iter().chain(lines).collect()
}
