//! The workspace as cargo reports it: its folder, its members and their dependencies.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Names of crates of this workspace.
pub type Names = BTreeSet<String>;

/// Crates of this workspace on which one member depends, by kind of dependency.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Arrows {
    /// Dependencies of the crate itself.
    pub normal: Names,
    /// Dependencies of the crate's `build.rs`.
    pub build: Names,
    /// Dependencies that only the crate's tests use.
    pub tests: Names,
}

/// Cargo failed, or its output does not have the expected format.
#[derive(Debug, thiserror::Error)]
pub enum WorkspaceError {
    /// Cargo is not on the PATH, or the system refuses to start it.
    #[error("cargo does not start: {0}; is it on PATH?")]
    Start(#[from] std::io::Error),
    /// Cargo ended with another exit status than 0.
    #[error("`cargo {arguments}` failed:\n{message}\n  next: run it by hand")]
    Failed {
        /// Arguments of the failed command.
        arguments: String,
        /// Standard error of the failed command.
        message: String,
    },
    /// The output of `cargo metadata` is not JSON.
    #[error("`cargo metadata` printed no JSON: {0}; has its format changed?")]
    Json(#[from] serde_json::Error),
    /// A field is missing in the output of `cargo metadata`.
    #[error("`cargo metadata` printed no `{0}`; has its format changed?")]
    Field(&'static str),
}

/// Returns the folder of the workspace's root manifest.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Runs the cargo of this toolchain in the root folder and returns the standard output.
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

/// Returns the folder of every member, by crate name.
///
/// # Errors
/// Cargo is missing, fails, or its output has another format.
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

/// Returns the dependencies of every member on other members, by crate name.
///
/// # Errors
/// Cargo is missing, fails, or its output has another format.
pub fn arrows() -> Result<BTreeMap<String, Arrows>, WorkspaceError> {
    let mut all = BTreeMap::new();
    for package in packages()? {
        let mut arrows = Arrows::default();
        let dependencies = package["dependencies"].as_array();
        for dependency in dependencies.ok_or(WorkspaceError::Field("dependencies"))? {
            // A dependency with a path is a crate of this workspace; skip the others.
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

/// One member of a workspace, with the root files that cargo compiles.
#[derive(Debug, Clone)]
pub struct Package {
    /// Name of the package in its manifest.
    pub name: String,
    /// Folder of the package's manifest.
    pub folder: PathBuf,
    /// Library, programs, tests, examples and build script of the package.
    pub targets: Vec<Target>,
}

/// One crate that cargo compiles from a package.
#[derive(Debug, Clone)]
pub struct Target {
    /// Kind of target as cargo names it: "lib", "bin", "test", "example" or "custom-build".
    pub kind: String,
    /// Root file of the target.
    pub root: PathBuf,
}

impl Package {
    /// Returns every `.rs` file below the package's folder. Skips `target`, and folders with a manifest of
    /// their own, which are other packages.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn sources(&self) -> std::io::Result<Vec<PathBuf>> {
        let mut sources = Vec::new();
        let mut folders = vec![self.folder.clone()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder)? {
                let path = entry?.path();
                let own = path.file_name().is_none_or(|name| name != "target")
                    && !path.join("Cargo.toml").exists();
                if path.is_dir() && own {
                    folders.push(path);
                } else if path.extension().is_some_and(|extension| extension == "rs") {
                    sources.push(path);
                }
            }
        }
        Ok(sources)
    }
}

/// Returns the members of the workspace whose manifest is at the path `manifest`, relative to the root
/// folder.
///
/// # Errors
/// Cargo is missing, fails, or its output has another format.
pub fn members(manifest: &str) -> Result<Vec<Package>, WorkspaceError> {
    let member = |package: &Value| {
        let manifest = Path::new(text(package, "manifest_path")?);
        let folder = manifest
            .parent()
            .ok_or(WorkspaceError::Field("manifest_path"))?;
        let targets = package["targets"]
            .as_array()
            .ok_or(WorkspaceError::Field("targets"))?;
        let targets = targets.iter().map(|target| {
            Ok::<_, WorkspaceError>(Target {
                kind: target["kind"][0].as_str().unwrap_or_default().to_owned(),
                root: text(target, "src_path")?.into(),
            })
        });
        Ok(Package {
            name: text(package, "name")?.to_owned(),
            folder: folder.to_path_buf(),
            targets: targets.collect::<Result<_, _>>()?,
        })
    };
    packages_of(manifest)?.iter().map(member).collect()
}

fn packages() -> Result<Vec<Value>, WorkspaceError> {
    packages_of("Cargo.toml")
}

fn packages_of(manifest: &str) -> Result<Vec<Value>, WorkspaceError> {
    let answer = cargo(&[
        "metadata",
        "--no-deps",
        "--format-version=1",
        "--manifest-path",
        manifest,
    ])?;
    let mut metadata: Value = serde_json::from_str(&answer)?;
    match metadata["packages"].take() {
        Value::Array(packages) => Ok(packages),
        _ => Err(WorkspaceError::Field("packages")),
    }
}

fn text<'a>(object: &'a Value, field: &'static str) -> Result<&'a str, WorkspaceError> {
    object[field].as_str().ok_or(WorkspaceError::Field(field))
}
