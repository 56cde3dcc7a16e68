//! Commands that the subcommands of `cargo xtask` run, and the failure of a subcommand.

use std::env;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Target triple of the Cortex-M4F and the Cortex-M7, with single-precision FPU instructions.
pub(crate) const BOARD_TARGET: &str = "thumbv7em-none-eabihf";

/// Advice to the user when a program does not build.
pub(crate) const AFTER_A_BUILD: &str = "read the compiler's message above";

/// Advice to the user when a test fails.
pub(crate) const AFTER_A_TEST: &str =
    "run the failed test alone: `cargo test --package CRATE TEST_NAME`, its name as printed above";

/// A failure that ends a subcommand of `cargo xtask`.
#[derive(Debug)]
pub(crate) struct Failure {
    /// Exit status: 1 if a check failed, 2 if this machine lacks something.
    pub(crate) status: u8,
    pub(crate) message: String,
}

impl Failure {
    pub(crate) fn check(what: impl Display, why: impl Display, next: impl Display) -> Self {
        let message = format!("{what} failed: {why}\n  next: {next}");
        Self { status: 1, message }
    }

    pub(crate) fn missing(what: impl Display, why: impl Display, next: impl Display) -> Self {
        let message = format!("{what} is missing: {why}\n  next: {next}");
        Self { status: 2, message }
    }
}

/// Turns any error into a [`Failure::check`].
pub(crate) trait OrFail<T> {
    fn or_fail(self, what: impl Display, next: &str) -> Result<T, Failure>;
}

impl<T, E: Display> OrFail<T> for Result<T, E> {
    fn or_fail(self, what: impl Display, next: &str) -> Result<T, Failure> {
        self.map_err(|error| Failure::check(what, error, next))
    }
}

/// Prints a text to standard output. Ignores a pipe that its reader has closed, as `head` does.
///
/// # Errors
/// The output cannot be written for another reason.
pub(crate) fn print(text: impl Display) -> Result<(), Failure> {
    match write!(io::stdout(), "{text}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        printed => printed.or_fail("printing", "make room on the disk and repeat the command"),
    }
}

/// Returns a cargo command in the workspace's root; `words` are its arguments, separated by blanks.
pub(crate) fn cargo(words: &str) -> Command {
    // Use the cargo that runs this program, and so the toolchain chosen on the command line.
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

/// Returns the name of the toolchain in the emulated boards' rust-toolchain.toml, such as "1.98.0".
pub(crate) fn virtual_board_toolchain() -> &'static str {
    let file = include_str!("../../tests/virtual-board/rust-toolchain.toml");
    file.split('"').nth(1).unwrap_or("stable")
}

/// Returns the folder of the workspace's Cargo.toml, as it was when this program was compiled.
pub(crate) fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Returns cargo's target folder, which is two levels above this program's file.
pub(crate) fn target_folder() -> PathBuf {
    let program = env::current_exe().unwrap_or_default();
    program.ancestors().nth(2).unwrap_or(root()).to_owned()
}

/// Runs the command with this program's standard streams. A failure advises the user to do `next`.
pub(crate) fn run(command: &mut Command, next: &str) -> Result<(), Failure> {
    let status = command.status().or_fail(typed(command), next)?;
    if status.success() {
        return Ok(());
    }
    Err(Failure::check(typed(command), status, next))
}

/// Runs the command with this program's standard error, and returns its standard output. A failure
/// advises the user to do `next`.
pub(crate) fn output(command: &mut Command, next: &str) -> Result<String, Failure> {
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.or_fail(typed(command), next)?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    Err(Failure::check(typed(command), output.status, next))
}

/// Replaces this process by the command. The exit status of the command becomes that of `cargo
/// xtask`.
pub(crate) fn replace(command: &mut Command) -> Result<(), Failure> {
    Err(command.exec()).or_fail(typed(command), "is it installed?")
}

/// Returns whether the command starts and exits with status 0; discards its output.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}

/// Returns the command as a user types it: in backquotes, without the folder of its program.
pub(crate) fn typed(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name();
    let words = program.into_iter().chain(command.get_args());
    let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
    format!("`{}`", words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_command_is_shown_as_typed_with_why_and_what_next() {
        let mut command = Command::new("/bin/false");
        let failure = run(command.args(["test", "--package"]), "look there").expect_err("it fails");
        let expected = "`false test --package` failed: exit status: 1\n  next: look there";
        assert_eq!((failure.status, &failure.message[..]), (1, expected));
        assert!(virtual_board_toolchain().starts_with("1."));
    }

    #[test]
    fn a_missing_program_is_a_failure_and_no_panic() {
        let mut command = Command::new("no-such-program-anywhere");
        assert!(!succeeds(&mut command));
        assert!(run(&mut command, "").is_err() && replace(&mut command).is_err());
    }
}
