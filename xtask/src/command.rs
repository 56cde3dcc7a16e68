//! Commands that a verb runs, and the reasons why it stops.

use std::env;
use std::fmt::{self, Display};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

/// Target triple of the microcontrollers: Cortex-M4F and M7 with a single-precision FPU.
pub(crate) const BOARD_TARGET: &str = "thumbv7em-none-eabihf";

/// Advice to the user after a program that does not build.
pub(crate) const AFTER_A_BUILD: &str = "read the compiler's message above";

/// Reason why a verb stops: the exit status of this program and the message.
#[derive(Debug)]
pub(crate) struct Failure(u8, String);

impl Failure {
    /// A check did not pass; exit status 1.
    pub(crate) fn check(what: impl Display, why: impl Display, next: impl Display) -> Self {
        Self(1, format!("{what} failed: {why}\n  next: {next}"))
    }

    /// Something that the verb needs is not installed; exit status 2.
    pub(crate) fn missing(what: impl Display, why: impl Display, next: impl Display) -> Self {
        Self(2, format!("{what} is missing: {why}\n  next: {next}"))
    }

    pub(crate) fn exit_code(&self) -> ExitCode {
        self.0.into()
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.1)
    }
}

/// Returns a cargo command in the workspace's root; `words` are its arguments, separated by blanks.
pub(crate) fn cargo(words: &str) -> Command {
    // Use the cargo that runs this program, so that a toolchain chosen on the command line stays
    // chosen.
    let program = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(program);
    command.args(words.split_whitespace()).current_dir(root());
    command
}

/// Returns a cargo command in the workspace of the emulated boards, with that workspace's toolchain
/// and target folder.
pub(crate) fn virtual_board_cargo(words: &str) -> Command {
    let mut command = Command::new("rustup");
    command
        .args(["run", virtual_board_toolchain(), "cargo"])
        .args(words.split_whitespace())
        .current_dir(root().join("tests/virtual-board"))
        .env("CARGO_TARGET_DIR", target_folder().join("virtual-board"));
    command
}

/// Name of the Rust toolchain in the rust-toolchain.toml of the emulated boards.
pub(crate) fn virtual_board_toolchain() -> &'static str {
    let file = include_str!("../../tests/virtual-board/rust-toolchain.toml");
    let channel = file.split("channel = \"").nth(1);
    channel
        .and_then(|rest| rest.split('"').next())
        .unwrap_or("stable")
}

/// Folder of the workspace's Cargo.toml, fixed when this program is compiled.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap_or(Path::new("."))
}

/// Cargo's target folder: the parent of the folder that holds this program.
pub(crate) fn target_folder() -> PathBuf {
    let program = env::current_exe().unwrap_or_default();
    let folder = program.ancestors().nth(2).map(PathBuf::from);
    folder.unwrap_or_else(|| root().join("target"))
}

/// Returns the command as a user types it; arguments with blanks are in quotes.
pub(crate) fn typed(command: &Command) -> String {
    let program = command.get_program().to_string_lossy();
    // Leave out the folder of the toolchain.
    let mut words = vec![program.rsplit('/').next().unwrap_or_default().to_owned()];
    words.extend(
        command
            .get_args()
            .map(|argument| match argument.to_string_lossy() {
                argument if argument.contains(' ') => format!("'{argument}'"),
                argument => argument.into(),
            }),
    );
    words.join(" ")
}

/// Runs the command with this program's standard streams; `next` advises the user after a failure.
///
/// # Errors
/// The command does not start, or its exit status is not 0.
pub(crate) fn run(command: &mut Command, next: &str) -> Result<(), Failure> {
    let why = match command.status() {
        Ok(status) if status.success() => return Ok(()),
        Ok(status) => status.to_string(),
        Err(error) => error.to_string(),
    };
    Err(Failure::check(format!("`{}`", typed(command)), why, next))
}

/// Replaces this process by the command. The command's exit status becomes the verb's.
///
/// # Errors
/// The command does not start.
pub(crate) fn replace(command: &mut Command) -> Result<(), Failure> {
    let why = command.exec();
    Err(Failure::check(
        format!("`{}`", typed(command)),
        why,
        "is it installed?",
    ))
}

/// Returns whether the command starts and ends with status 0; its output is discarded.
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
    fn a_command_is_shown_as_a_user_types_it() {
        let mut command = Command::new("/opt/toolchain/bin/cargo");
        command.args(["test", "--package", "a b"]);
        assert_eq!(typed(&command), "cargo test --package 'a b'");
        assert!(virtual_board_toolchain().starts_with("1."));
    }

    #[test]
    fn a_failed_command_says_what_why_and_what_next() {
        let failure = run(&mut Command::new("false"), "look there").expect_err("it fails");
        let expected = "`false` failed: exit status: 1\n  next: look there";
        assert_eq!(failure.to_string(), expected);
    }

    #[test]
    fn a_missing_program_is_a_failure_and_no_panic() {
        let mut command = Command::new("no-such-program-anywhere");
        assert!(!succeeds(&mut command));
        assert!(run(&mut command, "").is_err() && replace(&mut command).is_err());
    }
}
