//! A test that cannot run here says so where everybody sees it.

use std::io::Write;

/// Says on the real standard error, past the test harness's capture, that something was not tested.
pub fn skipped(what: &str, why: &str) {
    // One write, so that lines of parallel tests stay whole. A closed stderr loses only this line.
    let line = format!("SKIPPED: {what}: {why}\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
}
