//! External programs that a benchmark uses if they are installed, and progress output.

use std::process::{Command, Stdio};

use indicatif::{ProgressBar, ProgressStyle};

/// Returns whether the command starts and exits with 0; its output is discarded.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    command.stdin(Stdio::null());
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// Returns the name under which a tool of LLVM is installed: without version, or with the newest version, as Debian
/// names them.
pub(crate) fn llvm(name: &str) -> Option<String> {
    let versions = (14..=24).rev().map(|version| format!("{name}-{version}"));
    std::iter::once(name.to_owned())
        .chain(versions)
        .find(|name| succeeds(Command::new(name).arg("--version")))
}

/// Returns a progress bar that is full after `ticks` increments.
pub(crate) fn progress_bar(ticks: usize) -> ProgressBar {
    let bar = ProgressBar::new(ticks.try_into().unwrap_or(u64::MAX));
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Prints why parts of a benchmark are left out.
pub(crate) fn print_skipped(reasons: &[String]) {
    for reason in reasons {
        eprintln!("SKIPPED: {reason}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_does_not_exist_does_not_succeed() {
        assert!(succeeds(&mut Command::new("true")));
        assert!(!succeeds(&mut Command::new("false")));
        assert_eq!(llvm("no-such-program-anywhere"), None);
    }
}
