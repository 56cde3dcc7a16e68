//! External programs that a benchmark uses if they are installed.

use std::process::{Command, Stdio};

use anyhow::Context;

/// Returns what a command prints, or `None` if it does not start or does not exit with 0.
pub(crate) fn output_of(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    let printed = String::from_utf8_lossy(&output.stdout);
    output.status.success().then(|| printed.into_owned())
}

/// Returns a command for a tool of LLVM. The tool's name may end with a version, as Debian names
/// the tools; the newest version is taken if there is no tool without one.
///
/// # Errors
/// The tool is not installed.
pub(crate) fn llvm(name: &str) -> anyhow::Result<Command> {
    let versions = (14..=24).rev().map(|version| format!("{name}-{version}"));
    let mut names = std::iter::once(name.to_owned()).chain(versions);
    let installed = names.find(|name| output_of(Command::new(name).arg("--version")).is_some());
    let missing = || format!("no {name}; Debian's package is `llvm`");
    Ok(Command::new(installed.with_context(missing)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_fails_or_does_not_exist_has_no_output() {
        assert_eq!(
            output_of(Command::new("echo").arg("hello")).as_deref(),
            Some("hello\n")
        );
        assert_eq!(output_of(&mut Command::new("false")), None);
        assert!(llvm("no-such-program-anywhere").is_err());
    }
}
