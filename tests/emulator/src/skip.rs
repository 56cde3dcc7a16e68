//! Reports about tests that cannot run on this machine, printed even if the harness captures
//! output.

use std::env;
use std::fmt::Display;
use std::io::Write;

/// Prints `SKIPPED: WHAT: WHY` to standard error, past the test harness, which captures
/// `eprintln!`.
pub fn skipped(what: &str, why: impl Display) {
    // One write, so that lines of parallel tests stay whole. If standard error is closed, only this
    // line is lost.
    let line = format!("SKIPPED: {what}: {why}\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
}

/// Reports that `test` is skipped because of `why`.
///
/// # Panics
/// With `CORTICODE_REQUIRE_ROS=1`: CI must not skip tests whose programs can be installed.
pub fn skip_unless_required(test: &str, why: impl Display) {
    let required = env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(
        !required,
        "{test}: CORTICODE_REQUIRE_ROS=1 forbids to skip it: {why}"
    );
    skipped(test, why);
}
