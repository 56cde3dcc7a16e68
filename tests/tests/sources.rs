//! The locked packages obey deny.toml: its sections `sources`, `bans` and `advisories.yanked`.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::process::Command;

use acceptance::workspace;
use emulator::skip::skip_unless_required;
use toml::Table;

/// Folders of the workspaces with a deny.toml: the main one, and that of the virtual boards, which only tests
/// run.
const WORKSPACES: [&str; 2] = [".", "tests/virtual-board"];

/// Value of a package's `source` in a lock file if the package comes from crates.io.
const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// A package in a lock file.
#[derive(Debug, Clone)]
struct Package {
    name: String,
    version: String,
    /// Source of the package; `None` for the workspace's own packages.
    source: Option<String>,
}

#[test]
fn every_package_comes_from_crates_io() {
    for workspace in WORKSPACES {
        let sources = &policy(workspace)["sources"];
        for rule in ["unknown-registry", "unknown-git"] {
            assert_eq!(sources[rule].as_str(), Some("deny"), "{workspace}: {rule}");
        }
        for Package { name, source, .. } in locked(workspace) {
            assert!(
                source.as_deref().is_none_or(|source| source == CRATES_IO),
                "{workspace}: {name} comes from {source:?}"
            );
        }
    }
}

#[test]
fn no_banned_package_is_locked() {
    for workspace in WORKSPACES {
        let policy = policy(workspace);
        let banned = policy["bans"].get("deny").and_then(|list| list.as_array());
        let banned = banned.into_iter().flatten();
        let packages = locked(workspace);
        for entry in banned {
            let name = entry["crate"].as_str().expect("a name");
            assert!(
                packages.iter().all(|package| package.name != name),
                "{workspace}: {name} is locked; deny.toml: {entry}"
            );
        }
    }
}

#[test]
fn no_package_of_ours_asks_for_any_version() {
    for workspace in WORKSPACES {
        assert_eq!(
            policy(workspace)["bans"]["wildcards"].as_str(),
            Some("deny")
        );
        let manifest = format!("--manifest-path={workspace}/Cargo.toml");
        let metadata = ["metadata", "--no-deps", "--format-version=1", &manifest];
        let metadata = workspace::cargo(&metadata).expect("cargo metadata");
        let metadata: serde_json::Value = serde_json::from_str(&metadata).expect("JSON");
        let packages = metadata["packages"].as_array().expect("packages").iter();
        for dependency in packages
            .filter_map(|package| package["dependencies"].as_array())
            .flatten()
        {
            // Packages of this workspace have a path and no version, so `*` is allowed for them.
            let is_wild = dependency["path"].is_null() && dependency["req"] == "*";
            assert!(!is_wild, "{workspace}: {dependency}");
        }
    }
}

#[test]
fn packages_with_several_versions_are_counted_and_refused_where_deny_toml_says_so() {
    for workspace in WORKSPACES {
        let mut versions: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for package in locked(workspace) {
            versions
                .entry(package.name)
                .or_default()
                .push(package.version);
        }
        versions.retain(|_, versions| versions.len() > 1);
        println!(
            "{workspace}: {} packages with several versions: {versions:?}",
            versions.len()
        );
        let policy = policy(workspace);
        match policy["bans"]["multiple-versions"].as_str() {
            Some("warn") => {}
            Some("deny") => assert!(versions.is_empty(), "{workspace}: {versions:?}"),
            other => panic!("{workspace}: multiple-versions = {other:?} is not checked here"),
        }
    }
}

/// With the lock file, cargo accepts a version that has been yanked. The test therefore resolves the versions
/// without it.
#[test]
fn no_locked_version_is_yanked() {
    for workspace in WORKSPACES {
        assert_eq!(
            policy(workspace)["advisories"]["yanked"].as_str(),
            Some("deny")
        );
        if let Err(message) = resolve_without_lock(&locked(workspace)) {
            assert!(!message.contains("is yanked"), "{workspace}: {message}");
            skip_unless_required("yanked versions", message);
        }
    }
}

#[test]
fn a_yanked_version_is_found() {
    // This version was withdrawn by its authors in 2026; the workspace does not use it.
    let yanked = Package {
        name: "chacha20".to_owned(),
        version: "0.10.1".to_owned(),
        source: Some(CRATES_IO.to_owned()),
    };
    let message = resolve_without_lock(&[yanked]).expect_err("cargo refuses it");
    if !message.contains("version 0.10.1 is yanked") {
        skip_unless_required("yanked versions", message);
    }
}

/// Makes cargo resolve exactly these versions as dependencies of an empty package. Returns cargo's messages
/// if that fails.
fn resolve_without_lock(packages: &[Package]) -> Result<(), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut manifest =
        "[package]\nname = \"unlocked\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n"
            .to_owned();
    for (index, Package { name, version, .. }) in from_registry(packages).enumerate() {
        // Two versions of one package need two different names.
        let line = format!(
            "p{index} = {{ package = {name:?}, version = \"={version}\", default-features = false }}"
        );
        writeln!(manifest, "{line}").expect("memory");
    }
    fs::create_dir(folder.path().join("src")).expect("a folder");
    fs::write(folder.path().join("src/lib.rs"), "").expect("a file");
    fs::write(folder.path().join("Cargo.toml"), manifest).expect("a file");
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    let output = cargo
        .arg("generate-lockfile")
        .current_dir(folder.path())
        .output();
    let output = output.expect("cargo starts");
    if output.status.success() {
        return Ok(());
    }
    Err(String::from_utf8_lossy(&output.stderr).into_owned())
}

fn from_registry(packages: &[Package]) -> impl Iterator<Item = &Package> {
    packages.iter().filter(|package| package.source.is_some())
}

/// Returns the packages in the lock file of a workspace.
fn locked(workspace: &str) -> Vec<Package> {
    let lock = table(workspace, "Cargo.lock");
    let packages = lock["package"].as_array().expect("packages").iter();
    let packages: Vec<Package> = packages
        .map(|package| {
            let text = |key| {
                package
                    .get(key)
                    .and_then(|value| value.as_str())
                    .map(str::to_owned)
            };
            Package {
                name: text("name").expect("a name"),
                version: text("version").expect("a version"),
                source: text("source"),
            }
        })
        .collect();
    assert!(
        from_registry(&packages).count() > 50,
        "{workspace}: too few packages"
    );
    packages
}

fn policy(workspace: &str) -> Table {
    table(workspace, "deny.toml")
}

fn table(workspace: &str, file: &str) -> Table {
    let path = workspace::root().join(workspace).join(file);
    let text = fs::read_to_string(path).expect("a file of the workspace");
    text.parse().expect("TOML")
}
