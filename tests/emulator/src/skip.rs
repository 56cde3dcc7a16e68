//! Reports tests that cannot run on this machine, even if the test harness captures output.

use std::env;
use std::fmt::Display;
use std::io::Write;

/// Prints `SKIPPED: WHAT: WHY` to standard error directly: the test harness captures `eprintln!`.
pub fn skipped(what: &str, why: impl Display) {
    // Write the line in one call, so that tests which run in parallel do not mix their lines. If
    // standard error is closed, only this line is lost.
    let line = format!("SKIPPED: {what}: {why}\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
}

/// Reports that the test named `test` is skipped, and why.
///
/// # Panics
/// If `CORTICODE_REQUIRE_ROS=1` is set: CI must not skip tests whose programs can be installed.
pub fn skip_unless_required(test: &str, why: impl Display) {
    let required = env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(!required, "{test}: CORTICODE_REQUIRE_ROS=1 forbids to skip it: {why}");
    skipped(test, why);
}
