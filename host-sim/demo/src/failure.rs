//! Reasons why the demo stops, and their exit status.

use std::fmt::Display;

/// Failure with which the demo ends.
#[derive(Debug)]
pub(crate) struct Failure {
    /// Exit status: 1 if a check failed, 2 if a file is missing, 3 if a part of the path did not
    /// start or did not answer, 130 after Ctrl-C.
    pub(crate) status: u8,
    /// What failed, why, and what the user can do next.
    pub(crate) message: String,
}

impl Failure {
    pub(crate) fn check(what: &str, why: impl Display, next: &str) -> Self {
        Self::new(1, what, "failed", why, next)
    }

    pub(crate) fn missing(what: &str, why: impl Display, next: &str) -> Self {
        Self::new(2, what, "is missing", why, next)
    }

    pub(crate) fn unreachable(what: &str, why: impl Display, next: &str) -> Self {
        Self::new(3, what, "is not reachable", why, next)
    }

    fn new(status: u8, what: &str, problem: &str, why: impl Display, next: &str) -> Self {
        let message = format!("{what} {problem}: {why}\n  next: {next}");
        Self { status, message }
    }

    pub(crate) fn interrupted() -> Self {
        let message = "interrupted; everything that was started is stopped".to_owned();
        Self {
            status: 130,
            message,
        }
    }
}
