//! The files of a crate depend on each other in one direction only, and every file is compiled.
#![forbid(unsafe_code)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use acceptance::modules::Modules;
use acceptance::workspace::{self, Package};

/// Returns every member of the workspace, and the virtual boards, which are a separate workspace.
fn packages() -> Vec<Package> {
    let mut packages = workspace::members("Cargo.toml").expect("cargo metadata");
    packages.extend(workspace::members("tests/virtual-board/Cargo.toml").expect("cargo metadata"));
    assert!(
        packages.len() > 20,
        "found only {} packages",
        packages.len()
    );
    packages
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let mut circles = Vec::new();
    for package in packages() {
        let shipped = package.targets.iter();
        for target in shipped.filter(|target| ["lib", "bin"].contains(&target.kind.as_str())) {
            let modules = Modules::read(&target.root).expect("sources that compile");
            for circle in modules.circles() {
                let names: Vec<String> = circle
                    .iter()
                    .map(|file| file.strip_prefix(&package.folder).unwrap_or(file))
                    .map(|file| file.display().to_string())
                    .collect();
                circles.push(format!("{}: {}", package.name, names.join(", ")));
            }
        }
    }
    assert!(
        circles.is_empty(),
        "move what both sides need into a file of its own, and import by module path instead of \
         through the crate's root:\n{}",
        circles.join("\n")
    );
}

#[test]
fn every_source_file_is_declared_by_a_module() {
    let mut declared = BTreeSet::new();
    let mut sources = BTreeSet::new();
    for package in packages() {
        for target in &package.targets {
            let modules = Modules::read(&target.root).expect("sources that compile");
            declared.extend(modules.files().map(|file| canonical(file)));
        }
        let files = package.sources().expect("readable folders");
        sources.extend(files.iter().map(|file| canonical(file)));
    }
    let orphans: Vec<_> = sources.difference(&declared).collect();
    assert!(
        orphans.is_empty(),
        "nothing compiles these files; delete them, or declare them with `mod`:\n{orphans:#?}"
    );
}

/// Returns the path of a file without `..`, which a `#[path]` attribute can contain.
fn canonical(file: &Path) -> PathBuf {
    file.canonicalize().expect("an existing file")
}
