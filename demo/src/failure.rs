//! Reasons why the demo stops, and their exit status.

use std::process::ExitCode;

/// Reason why the demo stopped: what failed, why it failed, and what the user can do next.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    #[error("{what} failed: {why}\n  next: {next}")]
    Check {
        what: String,
        why: String,
        next: String,
    },
    /// A file or program that must exist before the demo starts is missing.
    #[error("{what} is missing: {why}\n  next: {next}")]
    Missing {
        what: String,
        why: String,
        next: String,
    },
    /// A part of the path, such as the bridge, did not start or did not answer.
    #[error("{what} is not reachable: {why}\n  next: {next}")]
    Unreachable {
        what: String,
        why: String,
        next: String,
    },
    /// The user pressed Ctrl-C.
    #[error("interrupted; everything that was started is stopped")]
    Interrupted,
}

impl Failure {
    pub(crate) fn not_built(why: &str) -> Self {
        Self::Missing {
            what: "a built program".to_owned(),
            why: why.to_owned(),
            next: "`cargo demo`, which builds all programs before it starts this one".to_owned(),
        }
    }

    pub(crate) fn unreachable(what: &str, why: &str, next: &str) -> Self {
        Self::Unreachable {
            what: what.to_owned(),
            why: why.to_owned(),
            next: next.to_owned(),
        }
    }

    /// Exit status: 1 if a check failed, 2 if something is missing, 3 if a part is not reachable,
    /// 130 after Ctrl-C.
    pub(crate) fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Check { .. } => 1,
            Self::Missing { .. } => 2,
            Self::Unreachable { .. } => 3,
            Self::Interrupted => 130,
        })
    }
}
