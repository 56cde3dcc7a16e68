//! Result of a check, and the report of all checks.

use std::fmt;

use serde::Serialize;

/// Severity of a check's finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Level {
    Ok,
    /// The bridge works, with a restriction.
    Warning,
    /// The bridge does not work.
    Error,
    /// The check could not be made.
    Unknown,
}

/// Finding of one check, with the remedy if the finding is not ok.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Check {
    #[serde(rename = "check")]
    pub(crate) name: &'static str,
    pub(crate) level: Level,
    pub(crate) finding: String,
    /// Command to type, or what else helps.
    pub(crate) remedy: Option<String>,
}

impl Check {
    pub(crate) fn ok(name: &'static str, finding: impl Into<String>) -> Check {
        Check {
            name,
            level: Level::Ok,
            finding: finding.into(),
            remedy: None,
        }
    }

    pub(crate) fn warning(
        name: &'static str,
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Check {
        Check {
            level: Level::Warning,
            remedy: Some(remedy.into()),
            ..Check::ok(name, finding)
        }
    }

    pub(crate) fn error(
        name: &'static str,
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Check {
        Check {
            level: Level::Error,
            ..Check::warning(name, finding, remedy)
        }
    }

    pub(crate) fn unknown(
        name: &'static str,
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Check {
        Check {
            level: Level::Unknown,
            ..Check::warning(name, finding, remedy)
        }
    }
}

/// All checks; prints one line for each, and a second one with the remedy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Report {
    pub(crate) checks: Vec<Check>,
    pub(crate) errors: usize,
    pub(crate) warnings: usize,
}

impl Report {
    pub(crate) fn new(checks: Vec<Check>) -> Report {
        let count = |level| checks.iter().filter(|check| check.level == level).count();
        Report {
            errors: count(Level::Error),
            warnings: count(Level::Warning),
            checks,
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for check in &self.checks {
            let level = match check.level {
                Level::Ok => "ok",
                Level::Warning => "warning",
                Level::Error => "error",
                Level::Unknown => "unknown",
            };
            writeln!(formatter, "{level:<8} {:<14} {}", check.name, check.finding)?;
            if let Some(remedy) = &check.remedy {
                writeln!(formatter, "{:<24}try: {remedy}", "")?;
            }
        }
        let plural = |count| if count == 1 { "" } else { "s" };
        let Report {
            errors, warnings, ..
        } = self;
        let (error_s, warning_s) = (plural(*errors), plural(*warnings));
        write!(
            formatter,
            "\n{errors} error{error_s}, {warnings} warning{warning_s}"
        )
    }
}
