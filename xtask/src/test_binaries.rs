//! Test binaries, several of which run at the same time. `cargo test` runs one after the other, and
//! leaves cores idle while the last test of a binary waits.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Mutex;
use std::{io, thread};

use serde::Deserialize;

use crate::command::{AFTER_A_BUILD, AFTER_A_TEST, Failure, OrFail, cargo};

/// A test binary, and the folder of its package, in which it runs.
pub(crate) struct TestBinary {
    program: PathBuf,
    folder: PathBuf,
}

/// The parts that are used of a message of cargo.
#[derive(Deserialize)]
struct Message {
    executable: Option<PathBuf>,
    manifest_path: Option<PathBuf>,
    profile: Option<Profile>,
}

#[derive(Deserialize)]
struct Profile {
    test: bool,
}

/// Builds the test binaries of `selection`, which are arguments of cargo, and returns them.
pub(crate) fn build(selection: &str) -> Result<Vec<TestBinary>, Failure> {
    let words = format!("test --no-run --message-format=json-render-diagnostics {selection}");
    let what = format!("`cargo {words}`");
    let built = cargo(&words).stderr(Stdio::inherit()).output();
    let built = built.or_fail(&what, AFTER_A_BUILD)?;
    if !built.status.success() {
        return Err(Failure::check(what, built.status, AFTER_A_BUILD));
    }
    Ok(binaries(&String::from_utf8_lossy(&built.stdout)))
}

/// Returns the test binaries that cargo's messages name, one JSON object a line.
fn binaries(messages: &str) -> Vec<TestBinary> {
    let binary = |line: &str| {
        let message: Message = serde_json::from_str(line).ok()?;
        message.profile.filter(|profile| profile.test)?;
        Some(TestBinary {
            program: message.executable?,
            folder: message.manifest_path?.parent()?.to_owned(),
        })
    };
    messages.lines().filter_map(binary).collect()
}

/// Runs the binaries, `at_once` of them at a time, and prints the output of each when it ends. Calls
/// `prepare` with the command of each. Fails at the end if one of them failed.
pub(crate) fn run(
    binaries: &[TestBinary],
    at_once: usize,
    prepare: impl Fn(&mut Command) + Sync,
) -> Result<(), Failure> {
    let next = Mutex::new(binaries.iter());
    let failed = Mutex::new(Vec::new());
    let take = || next.lock().ok()?.next();
    thread::scope(|scope| {
        for _ in 0..at_once {
            scope.spawn(|| {
                while let Some(binary) = take() {
                    let mut test = Command::new(&binary.program);
                    prepare(test.current_dir(&binary.folder));
                    let output = test.output();
                    let passed = output.as_ref().is_ok_and(|output| output.status.success());
                    print(&binary.folder, output);
                    if !passed && let Ok(mut failed) = failed.lock() {
                        failed.push(binary.folder.display().to_string());
                    }
                }
            });
        }
    });
    let failed = failed.into_inner().unwrap_or_default();
    if failed.is_empty() {
        return Ok(());
    }
    let why = format!("tests failed in {}", failed.join(", "));
    Err(Failure::check("`cargo test`", why, AFTER_A_TEST))
}

/// Prints the output of the tests of the package in `folder`, without that of another one in
/// between.
fn print(folder: &Path, output: io::Result<Output>) {
    let mut stdout = io::stdout().lock();
    let printed = writeln!(stdout, "\n     Tests of {}", folder.display()).and_then(|()| {
        let output = output?;
        stdout.write_all(&output.stdout)?;
        stdout.write_all(&output.stderr)
    });
    if let Err(error) = printed {
        eprintln!("the tests of {}: {error}", folder.display());
    }
}

#[cfg(test)]
mod tests {
    use super::binaries;

    #[test]
    fn test_binaries_are_what_cargo_s_messages_name_as_such() {
        let messages = r#"{"executable":"/t/it-1","manifest_path":"/w/link/Cargo.toml","profile":{"test":true}}
{"executable":"/t/program","manifest_path":"/w/link/Cargo.toml","profile":{"test":false}}
{"executable":null,"manifest_path":"/w/link/Cargo.toml","profile":{"test":true}}
{"reason":"build-finished","success":true}"#;
        let found = binaries(messages);
        let [binary] = &found[..] else {
            panic!("{} binaries", found.len())
        };
        assert_eq!(binary.program.to_str(), Some("/t/it-1"));
        assert_eq!(binary.folder.to_str(), Some("/w/link"));
    }
}
