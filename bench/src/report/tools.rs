//! Programs that a benchmark uses where they are installed.

use std::process::{Command, Stdio};

/// Versions with which Debian suffixes the names of LLVM's tools.
const LLVM_VERSIONS: std::ops::RangeInclusive<u32> = 14..=24;

/// Whether the command starts and exits with 0; its output is discarded.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    let silent = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    silent.status().is_ok_and(|status| status.success())
}

/// Returns the name under which a tool of LLVM is installed: without version, or with the newest.
pub(crate) fn llvm(name: &str) -> Option<String> {
    let versions = LLVM_VERSIONS
        .rev()
        .map(|version| format!("{name}-{version}"));
    std::iter::once(name.to_owned())
        .chain(versions)
        .find(|name| succeeds(Command::new(name).arg("--version")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_does_not_exist_does_not_succeed() {
        assert!(succeeds(&mut Command::new("true")));
        assert!(!succeeds(&mut Command::new("false")));
        assert!(!succeeds(&mut Command::new("no-such-program-anywhere")));
        assert_eq!(llvm("no-such-program-anywhere"), None);
    }
}
