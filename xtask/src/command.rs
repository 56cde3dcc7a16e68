//! One command of a verb, shown as a person would type it.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::failure::Failure;

/// The cargo that runs us, so that a chosen toolchain stays chosen.
pub(crate) fn cargo() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// A cargo command in the workspace's root folder.
pub(crate) fn cargo_with(arguments: &[&str]) -> Command {
    let mut command = Command::new(cargo());
    command.args(arguments).current_dir(root());
    command
}

/// The folder of the root manifest.
pub(crate) fn root() -> &'static Path {
    // The manifest's folder is fixed when xtask is compiled; a moved checkout compiles it again.
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap_or(Path::new("."))
}

/// The command as typed in a shell; arguments with blanks in quotes.
pub(crate) fn typed(command: &Command) -> String {
    let mut words = Vec::new();
    let program = command.get_program().to_string_lossy().into_owned();
    // The full path of a rustup proxy tells a reader nothing.
    words.push(program.rsplit('/').next().unwrap_or(&program).to_owned());
    for argument in command.get_args() {
        let argument = argument.to_string_lossy();
        words.push(if argument.contains(' ') {
            format!("'{argument}'")
        } else {
            argument.into()
        });
    }
    words.join(" ")
}

/// Runs the command with our own output streams.
///
/// # Errors
/// It does not start, or its exit status is not 0.
pub(crate) fn run(command: &mut Command, next: &str) -> Result<(), Failure> {
    let failed = |why: String, command: &Command| Failure::Check {
        what: format!("`{}`", typed(command)),
        why,
        next: next.to_owned(),
    };
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(failed(status.to_string(), command)),
        Err(error) => Err(failed(error.to_string(), command)),
    }
}

/// Whether the command starts and ends with 0; its output is thrown away.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    let silent = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    silent.status().is_ok_and(|status| status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_shown_as_a_person_types_it() {
        let mut command = Command::new("/opt/toolchain/bin/cargo");
        command.args(["test", "--package", "a b"]);
        assert_eq!(typed(&command), "cargo test --package 'a b'");
    }

    #[test]
    fn a_failed_command_says_what_why_and_what_next() {
        let failure = run(&mut Command::new("false"), "look there").expect_err("it fails");
        let text = failure.to_string();
        assert!(text.contains("`false` failed"), "{text}");
        assert!(text.contains("exit status: 1"), "{text}");
        assert!(text.contains("next: look there"), "{text}");
    }

    #[test]
    fn a_missing_program_is_a_failure_and_no_panic() {
        let mut command = Command::new("no-such-program-anywhere");
        assert!(!succeeds(&mut command));
        assert!(run(&mut command, "").is_err());
    }
}
