//! The pipeline streams the codes of the batch reference also with other models than the built-in one. Each
//! model is built from an artifact, as a user builds it.
//!
//! `encoder_numpy.rs` compares the reference itself with numpy for networks of every mode, padding and pool.
#![forbid(unsafe_code)]

use std::process::Command;

use acceptance::{any_artifact::any_artifact, workspace};
use artifact::{
    CodeFormat,
    Mode::{self, Paper, PaperCodeOnly, Pca, Shortcut},
    Padding,
};

/// Models (mode, padding, pool, hop) that together use every kernel, both ends of a padded window, and an
/// encoder without each of its optional parts.
const VARIANTS: [(Mode, Padding, [usize; 3], usize); 6] = [
    (Paper, Padding::None, [2, 2, 2], 16),
    (Paper, Padding::None, [4, 3, 3], 8),
    (PaperCodeOnly, Padding::Space, [1, 2, 2], 8),
    (Shortcut, Padding::All, [2, 2, 2], 8),
    (Shortcut, Padding::All, [1, 3, 1], 16),
    (Pca, Padding::None, [2, 2, 2], 8),
];

/// Formats of codes, assigned to the variants in rotation.
const FORMATS: [CodeFormat; 3] = [
    CodeFormat::Int8Exponent,
    CodeFormat::Int16,
    CodeFormat::Int8,
];

#[test]
fn streaming_equals_batch_with_every_variant() {
    let formats = FORMATS.into_iter().cycle();
    for ((seed, (mode, padding, pool, hop)), format) in (1..).zip(VARIANTS).zip(formats) {
        let folder = tempfile::tempdir().expect("a folder");
        let mut artifact = any_artifact(seed, mode, padding, pool, hop).expect("a model");
        artifact.description.code.format = format;
        artifact.write(folder.path()).expect("a folder to write to");
        let test = [
            "test",
            "--package",
            "pipeline",
            "--test",
            "streaming_equals_batch",
        ];
        let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .args(test)
            .current_dir(workspace::root())
            .env("CORTICODE_ARTIFACT", folder.path())
            // Use a separate folder: in the usual one, each change of the model would rebuild the crates that
            // depend on it twice.
            .env("CARGO_TARGET_DIR", target().join("variants"))
            .output()
            .expect("cargo runs");
        let stdout = String::from_utf8_lossy(&output.stdout);
        let variant = format!("{mode:?}, padding {padding:?}, pool {pool:?}, hop {hop}, {format}");
        assert!(
            output.status.success(),
            "{variant}:\n{stdout}\n{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let result = stdout.lines().find(|line| line.starts_with("test result"));
        println!("{variant}: {}", result.expect("a test ran"));
    }
}

/// Returns cargo's target folder, in which this test was built.
fn target() -> std::path::PathBuf {
    let this = std::env::current_exe().expect("this program has a path");
    let profile = this.ancestors().nth(2).expect("target/profile/deps/test");
    profile.parent().expect("a target folder").to_owned()
}
