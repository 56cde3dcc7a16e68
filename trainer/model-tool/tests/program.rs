//! The program, as a user runs it.
#![forbid(unsafe_code)]

#[path = "program/broken.rs"]
mod broken;
#[path = "program/check.rs"]
mod check;
#[path = "program/export.rs"]
mod export;
#[path = "program/import.rs"]
mod import;
#[path = "program/pytorch.rs"]
mod pytorch;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Folder of the built-in model.
const BUILT_IN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/artifact");
/// Folder of the model with the paper's montage.
const PAPER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/paper");

/// Runs the program.
fn model_gen(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_model-gen"));
    command
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// Runs the program, which must end with a status; returns standard output and standard error.
fn run(arguments: &[&str], status: i32) -> [String; 2] {
    let output = model_gen(arguments);
    let [out, err] =
        [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("text"));
    assert_eq!(output.status.code(), Some(status), "{out}{err}");
    [out, err]
}

/// Returns the arguments that import a file of tensors with a specification.
fn import_words<'p>(out: &'p Path, [tensors, spec]: &'p [PathBuf; 2]) -> Vec<&'p str> {
    let [tensors, spec, out] = [tensors.as_path(), spec, out].map(text);
    vec![
        "import",
        "--safetensors",
        tensors,
        "--spec",
        spec,
        "--out",
        out,
    ]
}

/// Prints that a test is skipped on the standard error, which the test harness does not capture here.
fn skip(test: &str, why: &str) {
    let line = format!("SKIPPED: {test}: {why}\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}
