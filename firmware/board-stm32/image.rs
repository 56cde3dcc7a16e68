//! Part of each board's build script: sets the linker arguments and the version of the image.

use std::{env, fs, path::PathBuf, process::Command};

/// Sets the linker arguments for a memory map, and sets the environment variable
/// `CORTICODE_FIRMWARE` to the image's version and commit.
pub(crate) fn configure(memory_map: &str) {
    println!("cargo::rerun-if-changed={memory_map}");
    println!("cargo::rerun-if-changed=../../memory.x");
    println!("cargo::rustc-env=CORTICODE_FIRMWARE={}", version());
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    // memory.x in the workspace's root includes the memory map under the name board.x.
    fs::copy(memory_map, out.join("board.x")).expect("the memory map can be copied");
    println!("cargo::rustc-link-search={}", out.display());
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}

/// Returns the image's version and commit, for example `0.1.0 5d4b736`, with a `+` if there are
/// uncommitted changes. Without git, returns the version alone.
fn version() -> String {
    let version = env::var("CARGO_PKG_VERSION").expect("cargo sets it");
    // Build again when this file changes: git appends to it at every commit and change of branch.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={log}");
    }
    let Some(commit) = git(&["rev-parse", "--short=7", "HEAD"]) else {
        return version;
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]);
    let mark = if changed.is_some_and(|files| !files.is_empty()) { "+" } else { "" };
    format!("{version} {commit}{mark}")
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
