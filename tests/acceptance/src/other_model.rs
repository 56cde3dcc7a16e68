//! Programs and tests built with a model other than the one in the repository.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::Value;
use tempfile::TempDir;

use crate::workspace;

/// Crates that contain the model or depend on it; a build with another model compiles them again.
const DEPENDENTS: [&str; 9] = [
    "model",
    "pipeline",
    "device",
    "offline",
    "host-sim",
    "bridge-core",
    "capture",
    "bridge",
    "node",
];

static BUILDS: Mutex<()> = Mutex::new(());

/// Waits until no other test of this executable builds with another model, and returns a guard that
/// keeps the others waiting. Each build replaces the programs of the build before.
pub fn lock_builds() -> MutexGuard<'static, ()> {
    BUILDS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Programs and tests that cargo has built with a model other than the one in the repository.
#[derive(Debug)]
pub struct OtherModel {
    /// Folder with copies of the built executables.
    folder: TempDir,
    tests: Vec<PathBuf>,
}

impl OtherModel {
    /// Builds programs and tests with the model in the folder `artifact`. `words` are the arguments
    /// of cargo, such as `build --workspace --bin=host-sim`.
    ///
    /// # Panics
    /// When cargo fails or reports a warning.
    pub fn build(artifact: &Path, words: &str) -> Self {
        // Hold the lock until the executables are copied: the next build replaces them.
        let _builds = lock_builds();
        let folder = tempfile::tempdir().expect("a folder");
        let mut tests = Vec::new();
        let messages = succeed(cargo(words).env("CORTICODE_ARTIFACT", artifact));
        assert!(!messages.contains("warning: "), "{words}: {messages}");
        let messages = messages.lines().map(serde_json::from_str::<Value>);
        for message in messages.flatten() {
            let Some(built) = message["executable"].as_str() else {
                continue;
            };
            let name = Path::new(built).file_name().expect("a name");
            let copy = folder.path().join(name);
            fs::copy(built, &copy).expect("the executable is readable");
            if message["profile"]["test"] == true {
                tests.push(copy);
            }
        }
        Self { folder, tests }
    }

    /// Returns a command that starts the built program `name`.
    pub fn program(&self, name: &str) -> Command {
        Command::new(self.folder.path().join(name))
    }

    /// Runs the tests of the test target `target` whose names contain `filter`.
    ///
    /// # Panics
    /// When a test fails, or no test has such a name.
    pub fn test(&self, target: &str, filter: &str) {
        let is_of_target = |test: &&PathBuf| {
            let name = test.file_name().and_then(|name| name.to_str());
            name.is_some_and(|name| name.rsplit_once('-').is_some_and(|(name, _)| name == target))
        };
        let tests = self.tests.iter().filter(is_of_target);
        let printed: String = tests.map(|test| succeed(Command::new(test).arg(filter))).collect();
        let results = printed.lines().filter_map(|line| line.strip_prefix("test "));
        let passed = results.filter(|result| result.ends_with("... ok")).count();
        assert!(passed > 0, "no test of {target} has {filter:?} in its name: {printed}");
    }
}

/// Returns `cargo WORDS`, set up to build in the root folder with a model other than the checked-in
/// one.
///
/// Such builds use the target folder of this program, so that cargo compiles again only the crates
/// that depend on the model. These crates get a changed profile and thereby other file names, so
/// that the builds with the checked-in model remain. Programs, whose file names do not depend on
/// the profile, go to the folder `variants`.
fn cargo(words: &str) -> Command {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo
        .args(words.split(' '))
        .args(options())
        .arg("--message-format=json-render-diagnostics")
        .current_dir(workspace::root())
        .envs(environment());
    cargo
}

/// Returns the environment variables that select cargo's folders for builds with other models.
///
/// # Panics
/// When this program is not in a target folder of cargo.
pub fn environment() -> [(&'static str, PathBuf); 2] {
    [("CARGO_BUILD_BUILD_DIR", target()), ("CARGO_TARGET_DIR", programs())]
}

/// Returns cargo's folder for the programs built with other models.
///
/// # Panics
/// When this program is not in a target folder of cargo.
pub fn programs() -> PathBuf {
    target().join("variants")
}

fn target() -> PathBuf {
    let this = env::current_exe().expect("this program has a path");
    let profile = this.ancestors().nth(2).expect("target/profile/deps/test");
    profile.parent().expect("a target folder").to_owned()
}

/// Returns cargo's options that give the crates that depend on the model a profile of their own.
/// host-sim and bridge-core are built without optimisation, in half the time, because these tests
/// run host-sim only for some seconds.
pub fn options() -> impl Iterator<Item = String> {
    let option = |name: &str, value: &str| format!("--config=profile.dev.package.{name}.{value}");
    let changed = DEPENDENTS.map(|name| option(name, "debug=false"));
    let unoptimised = ["bridge-core", "host-sim"].map(|name| option(name, "opt-level=0"));
    changed.into_iter().chain(unoptimised)
}

/// Runs a command that must succeed, and returns its standard output and standard error.
///
/// # Panics
/// When the command fails.
pub fn succeed(command: &mut Command) -> String {
    let (succeeded, printed) = run(command);
    assert!(succeeded, "{command:?}:\n{printed}");
    printed
}

/// Runs a command that must fail, and returns its standard output and standard error.
///
/// # Panics
/// When the command succeeds.
pub fn fail(command: &mut Command) -> String {
    let (succeeded, printed) = run(command);
    assert!(!succeeded, "{command:?}:\n{printed}");
    printed
}

fn run(command: &mut Command) -> (bool, String) {
    let output = command.output().expect("the program starts");
    let printed = [output.stdout, output.stderr].concat();
    let printed = String::from_utf8_lossy(&printed).into_owned();
    (output.status.success(), printed)
}
