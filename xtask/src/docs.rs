//! `cargo xtask docs`: writes docs/figures.md from measurements; `test` compares the page with its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::command::{Failure, root, target_folder};
use crate::figures_page::{FiguresPage, Section};

const PAGE: &str = "docs/figures.md";

/// First lines of docs/figures.md.
const HEADER: &str = "# Figures

Every measured figure of the project, with the command that prints it. `cargo xtask docs` writes this page \
from `docs/figures.toml`; do not edit it. `cargo xtask test` fails when a figure of its own run differs by more \
than the tolerance in that file. [limits.md](limits.md) defines the words simulated and computed.
";

/// Returns the file for the JSON object of the verb `command`, such as `target/figures/bench-filters.json`.
pub(crate) fn object_file(command: &str) -> PathBuf {
    let name = command.replace(' ', "-");
    target_folder()
        .join("figures")
        .join(name)
        .with_extension("json")
}

/// Writes the JSON object of a verb to its file, for [`check`].
///
/// # Errors
/// The folder is not writable.
pub(crate) fn save(command: &str, object: &Value) -> Result<(), Failure> {
    let file = object_file(command);
    write(&file, &object.to_string())
}

/// Measures every figure, or reads the JSON objects from the folder `measured`, and writes the page.
///
/// # Errors
/// A command fails, or its object lacks a figure.
pub(crate) fn docs(measured: Option<&Path>) -> Result<(), Failure> {
    let source = source()?;
    let mut page = HEADER.to_owned();
    for section in page_description()?.sections {
        let object = match measured {
            Some(folder) => read(
                &folder.join(
                    object_file(&section.command)
                        .file_name()
                        .unwrap_or_default(),
                ),
            )?,
            None => measure(&section)?,
        };
        page += &section.markdown(&object, &source).map_err(|missing| {
            Failure::check(
                format!("`cargo xtask {} --json`", section.command),
                format!("its object lacks: {}", missing.join(", ")),
                "correct the pointers in docs/figures.toml",
            )
        })?;
    }
    write(&root().join(PAGE), &page)
}

/// Compares docs/figures.md with the JSON objects that the verbs of this run have written.
///
/// # Errors
/// A figure differs by more than its tolerance, or was not measured.
pub(crate) fn check() -> Result<(), Failure> {
    // The figures on the page were measured with real recordings among the inputs.
    if std::env::var_os("CORTICODE_DATA").is_none() {
        eprintln!("SKIPPED: the comparison with docs/figures.md needs CORTICODE_DATA");
        return Ok(());
    }
    let page = read_text(&root().join(PAGE))?;
    let mut differences = Vec::new();
    for section in page_description()?.sections {
        let object = read(&object_file(&section.command))?;
        differences.extend(section.differences(&page, &object));
    }
    if differences.is_empty() {
        return Ok(());
    }
    Err(Failure::check(
        PAGE,
        differences.join("\n  "),
        "if the change is meant: `cargo xtask docs --measured target/figures`",
    ))
}

fn page_description() -> Result<FiguresPage, Failure> {
    let file = root().join("docs/figures.toml");
    let error = |error| Failure::check(file.display(), error, "correct the file");
    toml::from_str(&read_text(&file)?).map_err(error)
}

/// Runs the command of a section and returns the JSON object that it prints.
fn measure(section: &Section) -> Result<Value, Failure> {
    let next = "run the command alone";
    let what = format!("`cargo xtask {} --json`", section.command);
    let own = std::env::current_exe().map_err(|error| Failure::check(&what, error, next))?;
    let mut command = Command::new(own);
    command.args(section.command.split(' ')).arg("--json");
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.map_err(|error| Failure::check(&what, error, next))?;
    serde_json::from_slice(&output.stdout).map_err(|error| Failure::check(&what, error, next))
}

/// Returns commit and date of the working tree, such as "commit 2f0fef8, 2026-11-22".
fn source() -> Result<String, Failure> {
    let mut git = Command::new("git");
    git.args(["log", "-1", "--date=short", "--format=commit %h, %cd"]);
    let output = git.current_dir(root()).output();
    let output = output.map_err(|error| Failure::missing("git", error, "install git"))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn read(file: &Path) -> Result<Value, Failure> {
    let text = read_text(file)?;
    serde_json::from_str(&text)
        .map_err(|error| Failure::check(file.display(), error, "measure again: `cargo xtask docs`"))
}

fn read_text(file: &Path) -> Result<String, Failure> {
    fs::read_to_string(file)
        .map_err(|error| Failure::check(file.display(), error, "measure again: `cargo xtask docs`"))
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    let folder = file.parent().unwrap_or(Path::new("."));
    let written = fs::create_dir_all(folder).and_then(|()| fs::write(file, text));
    written.map_err(|error| Failure::check(file.display(), error, "is its folder writable?"))
}
