//! The Python environment with the packages of `wheels.txt`, which `cargo xtask install` makes.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use emulator::skip::skip_unless_required;

use crate::workspace;

/// Returns the Python interpreter that has the packages of `tests/acceptance/wheels.txt`. Returns
/// `None`, and reports `test` as skipped, if the packages are not installed in the versions listed
/// there.
///
/// # Panics
/// When they are not installed and `CORTICODE_REQUIRE_ROS=1`, as in CI.
pub fn python(test: &str) -> Option<PathBuf> {
    let list = workspace::root().join("tests/acceptance/wheels.txt");
    let list = fs::read_to_string(list).expect("wheels.txt");
    let folder = folder();
    let installed = fs::read_to_string(folder.join("installed.txt"));
    if installed.is_ok_and(|installed| installed == list) {
        return Some(folder.join("bin/python"));
    }
    let why = format!(
        "{} lacks the packages of tests/acceptance/wheels.txt; `cargo xtask install` installs them",
        folder.display()
    );
    skip_unless_required(test, why);
    None
}

/// Returns the library of the Lab Streaming Layer in the package pylsl of the interpreter `python`.
///
/// # Panics
/// When Python does not start.
pub fn liblsl(python: &Path) -> PathBuf {
    let program = "import importlib.util; print(importlib.util.find_spec('pylsl').origin)";
    let output = Command::new(python).args(["-c", program]).output();
    let module = output.expect("python starts").stdout;
    let module = PathBuf::from(String::from_utf8(module).expect("a path"));
    module.with_file_name("lib").join("liblsl.so")
}

/// Returns the environment's folder, in the target folder in which cargo has built this program:
/// `TARGET/PROFILE/deps/PROGRAM`.
fn folder() -> PathBuf {
    let program = env::current_exe().unwrap_or_default();
    let target = program.ancestors().nth(3);
    target.unwrap_or(&workspace::root()).join("wheels")
}
