//! Checks what a laboratory needs before the bridge runs. The checks are pure functions of facts
//! that the program has collected about the machine.

pub(crate) mod device_checks;
pub(crate) mod port_checks;
pub(crate) mod ros2_checks;
pub(crate) mod ros_checks;

use std::fmt;

use lsl::LibraryError;
use serde::Serialize;

use crate::error::{BridgeError, causes};
use crate::realtime::{REMEDY, Refusal};

/// Severity of what a check found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Level {
    Ok,
    /// The bridge works, but the user should know of a restriction.
    Warning,
    /// The bridge does not work.
    Error,
    /// The check could not be made.
    Unknown,
}

/// What one check found, with the remedy if the level is not ok.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Check {
    #[serde(rename = "check")]
    pub(crate) name: &'static str,
    pub(crate) level: Level,
    pub(crate) finding: String,
    /// Command that helps, or other advice; `None` if the level is ok.
    pub(crate) remedy: Option<String>,
}

impl Check {
    pub(crate) fn ok(name: &'static str, finding: impl Into<String>) -> Check {
        Check { name, level: Level::Ok, finding: finding.into(), remedy: None }
    }

    pub(crate) fn warning(
        name: &'static str,
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Check {
        Check { level: Level::Warning, remedy: Some(remedy.into()), ..Check::ok(name, finding) }
    }

    pub(crate) fn error(
        name: &'static str,
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Check {
        Check { level: Level::Error, ..Check::warning(name, finding, remedy) }
    }

    pub(crate) fn unknown(
        name: &'static str,
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Check {
        Check { level: Level::Unknown, ..Check::warning(name, finding, remedy) }
    }
}

/// The findings of all checks. Prints a line for each, and below it a line with the remedy if any.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Report {
    pub(crate) checks: Vec<Check>,
    pub(crate) errors: usize,
    pub(crate) warnings: usize,
}

impl Report {
    pub(crate) fn new(checks: Vec<Check>) -> Report {
        let count = |level| checks.iter().filter(|check| check.level == level).count();
        Report { errors: count(Level::Error), warnings: count(Level::Warning), checks }
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
        let Report { errors, warnings, .. } = self;
        let (error_s, warning_s) = (plural(*errors), plural(*warnings));
        write!(formatter, "\n{errors} error{error_s}, {warnings} warning{warning_s}")
    }
}

/// Free disk space below which the check warns, bytes: two hours of all streams, at 8 MB a minute.
const LEAST_SPACE: u64 = 120 * 8_000_000;

/// Checks that liblsl could be loaded; `library` is liblsl's description of itself.
pub(crate) fn check_lsl(library: Result<String, LibraryError>) -> Check {
    const NAME: &str = "lsl";
    match library {
        Ok(description) => Check::ok(NAME, description),
        Err(error) => {
            let remedy = match error {
                LibraryError::File(..) => "leave out --liblsl and PYLSL_LIB, or name another file",
                _ => "pip install pylsl (then run with its python3 first on the PATH)",
            };
            Check::error(NAME, causes(&BridgeError::from(error)), remedy)
        }
    }
}

/// Checks that NTP has set the clock. `synchronised` is `None` if this cannot be found out.
pub(crate) fn check_clock(synchronised: Option<bool>) -> Check {
    const NAME: &str = "clock";
    match synchronised {
        Some(true) => Check::ok(NAME, "synchronised by NTP"),
        Some(false) => Check::warning(
            NAME,
            "not synchronised by NTP: stamps do not agree with other machines",
            "sudo timedatectl set-ntp true",
        ),
        None => Check::unknown(
            NAME,
            "its synchronisation cannot be read here",
            "timedatectl, or chronyc tracking",
        ),
    }
}

/// Checks whether the operating system grants real-time priority and locked memory.
pub(crate) fn check_realtime(granted: Result<(), Refusal>) -> Check {
    const NAME: &str = "real time";
    match granted {
        Ok(()) => Check::ok(NAME, "real-time priority and locked memory are permitted"),
        Err(refusal) => Check::warning(NAME, refusal.to_string(), REMEDY),
    }
}

/// Checks the free disk space of the current folder. `free` is in bytes, `None` if it is not known.
pub(crate) fn check_disk(free: Option<u64>) -> Check {
    const NAME: &str = "disk";
    let remedy = "df -h . (record in a folder with more space)";
    match free {
        Some(free) if free >= LEAST_SPACE => {
            Check::ok(NAME, format!("{} GB free in this folder", free / 1_000_000_000))
        }
        Some(free) => Check::warning(
            NAME,
            format!(
                "{} MB free in this folder: less than two hours of all streams",
                free / 1_000_000
            ),
            remedy,
        ),
        None => Check::unknown(NAME, "the free space cannot be read", remedy),
    }
}

#[cfg(test)]
mod tests {
    use super::{Level, check_clock, check_disk};

    #[test]
    fn a_clock_that_runs_free_is_a_warning_and_an_unreadable_one_unknown() {
        assert_eq!(check_clock(Some(true)).level, Level::Ok);
        let free = check_clock(Some(false));
        assert_eq!(free.level, Level::Warning);
        assert_eq!(free.remedy.as_deref(), Some("sudo timedatectl set-ntp true"));
        assert_eq!(check_clock(None).level, Level::Unknown);
    }

    #[test]
    fn a_disk_with_room_for_less_than_two_hours_is_a_warning() {
        let level = |free| check_disk(free).level;
        assert_eq!(level(Some(960_000_000)), Level::Ok);
        assert_eq!(level(Some(959_999_999)), Level::Warning);
        assert_eq!(level(None), Level::Unknown);
    }
}
