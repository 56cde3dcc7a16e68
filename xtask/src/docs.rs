//! `cargo xtask docs`: measures the figures and writes docs/figures.md; `cargo xtask test` compares
//! the page with its own measurements.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::command::{Failure, OrFail, root, run, target_folder};
use crate::figures_page::{FiguresPage, Section};

const PAGE: &str = "docs/figures.md";

/// First lines of docs/figures.md.
const HEADER: &str = "# Figures

Every measured figure of the project, with the command that prints it. `cargo xtask docs` writes this page \
from `docs/figures.toml`; do not edit it. `cargo xtask test` fails when a figure of its own run differs by more \
than the tolerance in that file. [limits.md](limits.md) defines the words simulated and computed.
";

/// Returns the folder to which the verbs write their JSON objects.
fn folder() -> PathBuf {
    target_folder().join("figures")
}

/// Returns the path of a verb's JSON object: `bench-filters.json` for "bench filters".
fn object_file(folder: &Path, verb: &str) -> PathBuf {
    folder.join(verb.replace(' ', "-")).with_extension("json")
}

/// Writes the JSON object of a verb to the file from which [`check`] reads it.
pub(crate) fn save(verb: &str, object: &Value) -> Result<(), Failure> {
    write(&object_file(&folder(), verb), &object.to_string())
}

/// Makes `program` also write the JSON object that it prints with `--json` to the file of `verb`.
/// Empties the file first, so that an object of an earlier run cannot be mistaken for the new one.
pub(crate) fn attach(program: &mut Command, verb: &str) -> Result<(), Failure> {
    let file = object_file(&folder(), verb);
    program.env("CORTICODE_OBJECT", &file);
    write(&file, "")
}

/// Measures every figure, or reads the JSON objects from the folder `measured` if it is given, and
/// writes docs/figures.md.
pub(crate) fn docs(measured: Option<&Path>) -> Result<(), Failure> {
    let source = source()?;
    let mut page = HEADER.to_owned();
    for section in sections()? {
        if measured.is_none() {
            measure(&section)?;
        }
        let object = object(measured.unwrap_or(&folder()), &section)?;
        page += &section.markdown(&object, &source).or_fail(
            format!("`cargo xtask {} --json`", section.command),
            "correct the pointers in docs/figures.toml",
        )?;
    }
    write(&root().join(PAGE), &page)
}

/// Compares docs/figures.md with the JSON objects that the verbs of this run have saved.
pub(crate) fn check() -> Result<(), Failure> {
    // The page states figures measured with real recordings; without them, this run has other
    // figures.
    if env::var_os("CORTICODE_DATA").is_none() {
        eprintln!("SKIPPED: the comparison with docs/figures.md needs CORTICODE_DATA");
        return Ok(());
    }
    let page = read(&root().join(PAGE))?;
    let mut differences = Vec::new();
    for section in sections()? {
        differences.extend(section.differences(&page, &object(&folder(), &section)?));
    }
    if differences.is_empty() {
        return Ok(());
    }
    let next = "if the change is meant: `cargo xtask docs --measured target/figures`";
    Err(Failure::check(PAGE, differences.join("\n  "), next))
}

fn sections() -> Result<Vec<Section>, Failure> {
    let file = root().join("docs/figures.toml");
    let page: Result<FiguresPage, _> = toml::from_str(&read(&file)?);
    Ok(page.or_fail(file.display(), "correct the file")?.sections)
}

/// Runs the verb of a section and makes it write its JSON object to the file that [`object`] reads.
fn measure(section: &Section) -> Result<(), Failure> {
    let mut verb = Command::new(env::current_exe().unwrap_or_default());
    attach(&mut verb, &section.command)?;
    run(
        verb.args(section.command.split(' ')),
        "run the command alone",
    )
}

/// Returns hash and date of the last commit, such as "commit 2f0fef8, 2026-11-22".
fn source() -> Result<String, Failure> {
    let mut git = Command::new("git");
    git.args(["log", "-1", "--date=short", "--format=commit %h, %cd"]);
    let output = git.current_dir(root()).output();
    let output = output.map_err(|error| Failure::missing("git", error, "install git"))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn object(folder: &Path, section: &Section) -> Result<Value, Failure> {
    let file = object_file(folder, &section.command);
    let object = serde_json::from_str(&read(&file)?);
    object.or_fail(file.display(), "measure again: `cargo xtask docs`")
}

fn read(file: &Path) -> Result<String, Failure> {
    fs::read_to_string(file).or_fail(file.display(), "measure again: `cargo xtask docs`")
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    let folder = file.parent().unwrap_or(Path::new("."));
    let written = fs::create_dir_all(folder).and_then(|()| fs::write(file, text));
    written.or_fail(file.display(), "is its folder writable?")
}
