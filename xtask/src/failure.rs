//! Why a verb stopped, and the exit status that says so.

use std::process::ExitCode;

/// Why a verb stopped: what, why, and what to do next.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// A check said no.
    #[error("{what} failed: {why}\n  next: {next}")]
    Check {
        /// The check.
        what: String,
        /// Its own words, or its exit status.
        why: String,
        /// A command or an action.
        next: String,
    },
    /// Something that must be installed is not.
    #[error("{what} is missing: {why}\n  next: {next}")]
    Missing {
        /// The thing.
        what: String,
        /// Why it was not installed on the way.
        why: String,
        /// The one line that installs it.
        next: String,
    },
    /// A part of the path did not come up or did not answer.
    #[error("{what} is not reachable: {why}\n  next: {next}")]
    Unreachable {
        /// The part.
        what: String,
        /// What was tried, for how long.
        why: String,
        /// What to look at.
        next: String,
    },
    /// The person pressed Ctrl-C.
    #[error("interrupted; everything that was started is stopped")]
    Interrupted,
}

impl Failure {
    /// 1: a check failed; 2: something is missing here; 3: not reachable; 130: Ctrl-C, as shells have it.
    pub(crate) fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Check { .. } => 1,
            Self::Missing { .. } => 2,
            Self::Unreachable { .. } => 3,
            Self::Interrupted => 130,
        })
    }
}
