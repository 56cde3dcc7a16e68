//! The workspace as cargo sees it: where it lies, its members and their arrows.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Names of our own crates.
pub type Names = BTreeSet<String>;

/// What one member depends on, by the purpose of the dependency; only our own crates.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Arrows {
    /// Linked into the crate.
    pub normal: Names,
    /// Linked into its `build.rs`.
    pub build: Names,
    /// Linked into its tests only.
    pub tests: Names,
}

/// Cargo could not be asked, or answered something else than before.
#[derive(Debug, thiserror::Error)]
pub enum WorkspaceError {
    /// The cargo binary did not start.
    #[error("cargo does not start: {0}; is it on PATH?")]
    Start(#[from] std::io::Error),
    /// Cargo ended with an error.
    #[error("`cargo {arguments}` failed; run it by hand. It said:\n{message}")]
    Failed {
        /// What it was asked.
        arguments: String,
        /// Its standard error.
        message: String,
    },
    /// The answer is not the JSON of `cargo metadata`.
    #[error("`cargo metadata` answered no JSON: {0}; has its format changed?")]
    Json(#[from] serde_json::Error),
    /// A field of the answer is missing.
    #[error("`cargo metadata` answered without `{0}`; has its format changed?")]
    Field(&'static str),
}

/// Folder of the workspace's root manifest.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// What cargo prints on standard output, asked in the root folder with this toolchain.
///
/// # Errors
/// Cargo is missing or fails.
pub fn cargo(arguments: &[&str]) -> Result<String, WorkspaceError> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(arguments)
        .current_dir(root())
        .output()?;
    if !output.status.success() {
        return Err(WorkspaceError::Failed {
            arguments: arguments.join(" "),
            message: String::from_utf8_lossy(&output.stderr).into_owned(),
        });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Folder of every member, by crate name.
///
/// # Errors
/// Cargo is missing, fails, or answers in another format.
pub fn folders() -> Result<BTreeMap<String, PathBuf>, WorkspaceError> {
    let mut folders = BTreeMap::new();
    for package in packages()? {
        let manifest = text(&package, "manifest_path")?;
        let folder = Path::new(manifest)
            .parent()
            .ok_or(WorkspaceError::Field("manifest_path"))?;
        folders.insert(text(&package, "name")?.to_owned(), folder.to_path_buf());
    }
    Ok(folders)
}

/// Arrows of every member, by crate name.
///
/// # Errors
/// Cargo is missing, fails, or answers in another format.
pub fn arrows() -> Result<BTreeMap<String, Arrows>, WorkspaceError> {
    let mut all = BTreeMap::new();
    for package in packages()? {
        let mut arrows = Arrows::default();
        let dependencies = package["dependencies"].as_array();
        for dependency in dependencies.ok_or(WorkspaceError::Field("dependencies"))? {
            // Only a path dependency is ours.
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
        all.insert(text(&package, "name")?.to_owned(), arrows);
    }
    Ok(all)
}

fn packages() -> Result<Vec<Value>, WorkspaceError> {
    let answer = cargo(&["metadata", "--no-deps", "--format-version", "1"])?;
    let mut metadata: Value = serde_json::from_str(&answer)?;
    match metadata["packages"].take() {
        Value::Array(packages) => Ok(packages),
        _ => Err(WorkspaceError::Field("packages")),
    }
}

fn text<'a>(object: &'a Value, field: &'static str) -> Result<&'a str, WorkspaceError> {
    object[field].as_str().ok_or(WorkspaceError::Field(field))
}
