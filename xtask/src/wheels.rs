//! The Python environment of the acceptance tests, with the packages of `wheels.txt`.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::command::{Failure, OrFail, root, run, succeeds, target_folder};

/// File that lists the packages of the environment, relative to the workspace's root.
const LIST: &str = "tests/acceptance/wheels.txt";
/// Name of the folder of the Python environment, in cargo's target folder.
const FOLDER: &str = "wheels";
/// Name of the copy of `wheels.txt` in the environment's folder. The copy is written last, so it
/// exists only in a complete environment.
const INSTALLED: &str = "installed.txt";
/// Debian's Python. Another one on the PATH may lack the module `venv`.
const PYTHON: &str = "/usr/bin/python3";

/// Creates the environment, unless it already has the packages of `wheels.txt`.
pub(crate) fn install() -> Result<(), Failure> {
    let list = root().join(LIST);
    let packages = fs::read_to_string(&list).or_fail(list.display(), "restore the file")?;
    let folder = target_folder().join(FOLDER);
    if is_complete(&folder, &packages) {
        return Ok(());
    }
    let next = "see the message above; the packages come from the index that pip is set up for";
    run(Command::new(PYTHON).args(["-m", "venv", "--clear"]).arg(&folder), next)?;
    // Do not compile the modules, because a test loads few of them. The list gives the version of
    // every package, so pip need not resolve dependencies; `pip check` reports a dependency that
    // the list lacks.
    let mut pip = Command::new(folder.join("bin/python"));
    pip.args(["-m", "pip", "install", "--quiet", "--no-deps"]);
    pip.args(["--no-compile", "--only-binary=:all:", "--requirement"]);
    run(pip.arg(&list), next)?;
    let mut check = Command::new(folder.join("bin/python"));
    run(check.args(["-m", "pip", "check"]), &format!("list it in {LIST}"))?;
    let copy = folder.join(INSTALLED);
    fs::write(&copy, packages).or_fail(copy.display(), "make room on the disk")
}

/// Returns whether the environment has the packages of the list `packages`, and its Python still
/// starts.
fn is_complete(folder: &Path, packages: &str) -> bool {
    let installed = fs::read_to_string(folder.join(INSTALLED));
    installed.is_ok_and(|installed| installed == packages)
        && succeeds(Command::new(folder.join("bin/python")).args(["-c", "import numpy"]))
}
