//! The workspace as cargo reports it: its folder, its members and their dependencies.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Names of crates of this workspace.
pub type Names = BTreeSet<String>;

/// A package in a cargo workspace, as `cargo metadata` reports it.
#[derive(Debug, Clone)]
pub struct Package {
    /// Name in the package's `Cargo.toml`.
    pub name: String,
    /// Folder that contains the package's `Cargo.toml`.
    pub folder: PathBuf,
    /// Root source files that cargo compiles: library, programs, tests, examples and build script.
    pub roots: BTreeSet<PathBuf>,
    /// Crates of this workspace on which the package depends.
    pub arrows: Arrows,
}

/// Crates of this workspace on which one package depends, by the kind of dependency.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Arrows {
    /// Crates on which the library and the programs depend.
    pub normal: Names,
    /// Crates on which the build script depends.
    pub build: Names,
    /// Crates on which only the tests depend.
    pub tests: Names,
}

/// Reason why cargo did not describe the workspace.
#[derive(Debug, thiserror::Error)]
pub enum WorkspaceError {
    /// Cargo is not on the PATH, or the system refuses to start it.
    #[error("cargo does not start: {0}; is it on PATH?")]
    Start(#[from] std::io::Error),
    /// Cargo ended with an exit status other than 0.
    #[error("`cargo {arguments}` failed:\n{message}\n  next: run it by hand")]
    Failed {
        /// Arguments of the failed call of cargo.
        arguments: String,
        /// What cargo wrote to its standard error.
        message: String,
    },
    /// The output of `cargo metadata` is not JSON.
    #[error("`cargo metadata` printed no JSON: {0}; has its format changed?")]
    Json(#[from] serde_json::Error),
    /// The output of `cargo metadata` lacks the named field.
    #[error("`cargo metadata` printed no `{0}`; has its format changed?")]
    Field(&'static str),
}

/// Returns the root folder of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Runs cargo with `arguments` in the root folder and returns its standard output.
///
/// # Errors
/// Cargo is missing or fails.
pub fn cargo(arguments: &[&str]) -> Result<String, WorkspaceError> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo).args(arguments).current_dir(root()).output()?;
    if !output.status.success() {
        return Err(WorkspaceError::Failed {
            arguments: arguments.join(" "),
            message: String::from_utf8_lossy(&output.stderr).into_owned(),
        });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Returns the members of the workspace whose root manifest is at the path `manifest`, relative to
/// the root folder.
///
/// # Errors
/// Cargo is missing, fails, or its output has another format.
pub fn packages(manifest: &str) -> Result<Vec<Package>, WorkspaceError> {
    let answer =
        cargo(&["metadata", "--no-deps", "--format-version=1", "--manifest-path", manifest])?;
    let metadata: Value = serde_json::from_str(&answer)?;
    list(&metadata, "packages")?.iter().map(package).collect()
}

fn package(package: &Value) -> Result<Package, WorkspaceError> {
    let manifest = Path::new(text(package, "manifest_path")?);
    let folder = manifest.parent();
    let targets = list(package, "targets")?.iter();
    let roots = targets.map(|target| text(target, "src_path").map(PathBuf::from));
    let mut arrows = Arrows::default();
    for dependency in list(package, "dependencies")? {
        // Only a dependency on a crate of this workspace has a path; skip all others.
        if dependency["path"].is_null() {
            continue;
        }
        let name = text(dependency, "name")?.to_owned();
        match dependency["kind"].as_str() {
            None => arrows.normal.insert(name),
            Some("build") => arrows.build.insert(name),
            Some(_) => arrows.tests.insert(name),
        };
    }
    Ok(Package {
        name: text(package, "name")?.to_owned(),
        folder: folder.ok_or(WorkspaceError::Field("manifest_path"))?.to_owned(),
        roots: roots.collect::<Result<_, _>>()?,
        arrows,
    })
}

fn list<'a>(object: &'a Value, field: &'static str) -> Result<&'a Vec<Value>, WorkspaceError> {
    object[field].as_array().ok_or(WorkspaceError::Field(field))
}

fn text<'a>(object: &'a Value, field: &'static str) -> Result<&'a str, WorkspaceError> {
    object[field].as_str().ok_or(WorkspaceError::Field(field))
}
