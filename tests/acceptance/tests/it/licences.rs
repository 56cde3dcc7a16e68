//! Every package that the project links has a licence that deny.toml allows.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use acceptance::workspace::{self, WorkspaceError};
use emulator::skip::skipped;
use spdx::{Expression, LicenseReq, ParseMode};

/// How licence expressions are parsed: as SPDX, but with `/` for `OR`, as in old manifests.
const MODE: ParseMode = ParseMode { allow_slash_as_or_operator: true, ..ParseMode::STRICT };

/// Folders of the two workspaces that have a deny.toml: the main workspace, and the virtual boards'
/// workspace, on which only tests depend.
const WORKSPACES: [&str; 2] = [".", "tests/virtual-board"];

#[test]
fn every_dependency_has_an_allowed_licence() {
    for workspace in WORKSPACES {
        let allowed = allowed(workspace);
        let refused: Vec<String> = dependencies(workspace)
            .into_iter()
            .filter(|(_, licence)| !accepts(&allowed, licence))
            .map(|(package, licence)| format!("{package}: {licence:?}"))
            .collect();
        assert!(
            refused.is_empty(),
            "not on the list of {workspace}/deny.toml; choose another crate or argue for the licence there:\n{}",
            refused.join("\n")
        );
    }
}

#[test]
fn every_allowed_licence_is_needed() {
    for workspace in WORKSPACES {
        let allowed = allowed(workspace);
        let dependencies = dependencies(workspace);
        for name in &allowed {
            let without = allowed.iter().filter(|other| *other != name).cloned().collect();
            assert!(
                dependencies.values().any(|licence| !accepts(&without, licence)),
                "{workspace}/deny.toml allows {name}, and nothing needs it: take it off the list"
            );
        }
    }
}

#[test]
fn a_copyleft_licence_and_a_missing_one_are_refused() {
    let allowed = allowed(".");
    assert!(accepts(&allowed, "MIT/Apache-2.0"));
    assert!(accepts(&allowed, "GPL-3.0-only OR MIT"));
    assert!(!accepts(&allowed, "GPL-3.0-only AND MIT"));
    assert!(!accepts(&allowed, "GPL-3.0-only"));
    assert!(!accepts(&allowed, "no such licence"));
    assert!(!accepts(&allowed, ""));
}

/// Returns the licences that the workspace's deny.toml lists as `allow` in its table `[licenses]`.
fn allowed(workspace: &str) -> BTreeSet<String> {
    let file = workspace::root().join(workspace).join("deny.toml");
    let text = fs::read_to_string(file).expect("deny.toml");
    let table: toml::Table = text.parse().expect("deny.toml is TOML");
    let list = table["licenses"]["allow"].as_array().expect("a list");
    list.iter().map(|name| name.as_str().expect("a licence").to_owned()).collect()
}

/// Returns the licence expression of every package that a target, build script or test of the
/// workspace links, by the package's name.
///
/// The list comes from `cargo tree`, because `cargo metadata` also lists packages that no enabled
/// feature needs.
fn dependencies(workspace: &str) -> BTreeMap<String, String> {
    let all = tree(workspace, &["--target=all"]).or_else(|error| {
        // Without a network, cargo lists only the packages that this machine has, and those for
        // other operating systems are missing.
        skipped("licences of other systems' packages", error);
        tree(workspace, &["--offline"])
    });
    let packages: BTreeMap<String, String> = all
        .expect("cargo tree")
        .lines()
        .filter_map(|line| line.split_once('|'))
        .map(|(package, licence)| (package.to_owned(), licence.to_owned()))
        .collect();
    assert!(packages.len() > 50, "cargo tree listed only {} packages", packages.len());
    packages
}

/// Returns the lines `PACKAGE|LICENCE` of `cargo tree`; the arguments `choice` select targets.
fn tree(workspace: &str, choice: &[&str]) -> Result<String, WorkspaceError> {
    let manifest = format!("--manifest-path={workspace}/Cargo.toml");
    let arguments = [
        "tree",
        &manifest,
        "--workspace",
        "--edges=normal,build,dev",
        "--prefix=none",
        "--no-dedupe",
        "--format={p}|{l}",
    ];
    workspace::cargo(&[&arguments, choice].concat())
}

/// Returns whether the expression `licence` can be satisfied with the licences in `allowed`.
fn accepts(allowed: &BTreeSet<String>, licence: &str) -> bool {
    let on_list = |required: &LicenseReq| allowed.contains(&required.to_string());
    Expression::parse_mode(licence, MODE).is_ok_and(|expression| expression.evaluate(on_list))
}
