//! Reasons for which a benchmark stops, and the program's exit status.

use std::fmt::Display;
use std::process::ExitCode;

use emulator::EmulatorError;

/// Reason for which a benchmark fails: what failed, why, and what to do next.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// A figure exceeds its limit, or a part of the measurement failed.
    #[error("{what} failed: {why}\n  next: {next}")]
    Check {
        what: String,
        why: String,
        /// Command or action that the user should try next.
        next: String,
    },
    /// An image was not built or did not run, or a file cannot be used.
    #[error(transparent)]
    Emulator(#[from] EmulatorError),
}

impl Failure {
    pub(crate) fn new(what: impl Display, why: impl Display, next: impl Display) -> Self {
        let [what, why, next] = [what.to_string(), why.to_string(), next.to_string()];
        Self::Check { what, why, next }
    }

    /// Returns the failure for an input that cannot be produced; for `map_err`.
    pub(crate) fn input(why: impl Display) -> Self {
        let next = "does CORTICODE_DATA name the right folder?";
        Self::new("making an input", why, next)
    }

    /// Returns 1 for a failed check, 2 if something must be installed first.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Emulator(error) if error.is_missing() => ExitCode::from(2),
            Self::Check { .. } | Self::Emulator(_) => ExitCode::from(1),
        }
    }
}
