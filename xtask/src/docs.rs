//! `cargo xtask docs`: measures the figures and writes docs/figures.md. `cargo xtask test` compares
//! the page with its own measurements.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Deserialize;
use serde_json::Value;

use crate::command::{Failure, OrFail, root, run, target_folder};

const PAGE: &str = "docs/figures.md";

/// First lines of docs/figures.md.
const HEADER: &str = "# Figures

Every measured figure of the project, with the command that prints it. `cargo xtask docs` writes this page \
from `docs/figures.toml`; do not edit it. `cargo xtask test` fails when a figure of its own run differs by more \
than the tolerance in that file. [limits.md](limits.md) defines the words simulated and computed.
";

/// Returns the folder to which the commands write their JSON objects.
fn folder() -> PathBuf {
    target_folder().join("figures")
}

/// Returns the path of the JSON object of the command `verb`, such as `bench-filters.json` for
/// "bench filters".
fn object_file(folder: &Path, verb: &str) -> PathBuf {
    folder.join(verb.replace(' ', "-")).with_extension("json")
}

/// Writes the JSON object of the command `verb` to the file from which [`check`] reads it.
pub(crate) fn save(verb: &str, object: &Value) -> Result<(), Failure> {
    write(&object_file(&folder(), verb), &object.to_string())
}

/// Makes `program` also write the JSON object that its option `--json` prints to the file for
/// `verb`. Empties the file first, so that no object of an earlier run is mistaken for the new one.
pub(crate) fn attach(program: &mut Command, verb: &str) -> Result<(), Failure> {
    let file = object_file(&folder(), verb);
    program.env("CORTICODE_OBJECT", &file);
    write(&file, "")
}

/// Measures every figure, or reads the JSON objects from the folder `measured`, and writes
/// docs/figures.md.
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

/// Compares docs/figures.md with the JSON objects that the commands of this run have saved.
pub(crate) fn check() -> Result<(), Failure> {
    // The page's figures are from real recordings; without recordings, this run has other figures.
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

/// Runs the command of a section, which writes its JSON object to the file that [`object()`] reads.
fn measure(section: &Section) -> Result<(), Failure> {
    let mut verb = Command::new(env::current_exe().unwrap_or_default());
    attach(&mut verb, &section.command)?;
    run(verb.args(section.command.split(' ')), "run the command alone")
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

/// Contents of `docs/figures.toml`: the sections of docs/figures.md, in the order of the page.
#[derive(Debug, Deserialize)]
struct FiguresPage {
    #[serde(rename = "section")]
    sections: Vec<Section>,
}

/// Section of the page: the figures that one command measures.
#[derive(Debug, Deserialize)]
struct Section {
    title: String,
    /// Arguments of `cargo xtask`; with `--json` added, the command prints one JSON object.
    command: String,
    note: String,
    #[serde(rename = "figure")]
    figures: Vec<Figure>,
}

/// One row of a section's table; the comment at the top of docs/figures.toml describes the fields.
#[derive(Debug, Deserialize)]
struct Figure {
    name: String,
    pointer: String,
    #[serde(default)]
    unit: String,
    scale: Option<f64>,
    #[serde(default)]
    decimals: usize,
    #[serde(default)]
    tolerance: f64,
    #[serde(default)]
    optional: bool,
}

impl Section {
    /// Returns the section's Markdown; `source` names the commit and date of the measurement.
    ///
    /// # Errors
    /// `measured` lacks a figure; the error names the figure.
    fn markdown(&self, measured: &Value, source: &str) -> Result<String, String> {
        let rows = self.figures.iter().map(|figure| {
            let Figure { name, unit, .. } = figure;
            let value = figure.value(measured);
            let value = value.ok_or_else(|| format!("its object lacks: {name}"))?;
            let value = grouped(value, figure.decimals);
            Ok(format!("| {name} | {value} | {unit} |\n"))
        });
        let rows = rows.collect::<Result<String, String>>()?;
        Ok(format!(
            "\n## {}\n\n{}\n\n`cargo xtask {} --json`, {source}\n\n\
             | Figure | Value | Unit |\n| --- | ---: | --- |\n{rows}",
            self.title, self.note, self.command
        ))
    }

    /// Returns one line for each figure that is missing on one side, or whose values in `page` and
    /// `measured` disagree. Only an optional figure may be absent from `measured`.
    fn differences(&self, page: &str, measured: &Value) -> Vec<String> {
        let mut sections = page.split("\n## ");
        let section = sections.find(|text| text.starts_with(&self.title));
        let section = section.unwrap_or_default();
        let differences = self.figures.iter().map(|figure| {
            let row = format!("| {} | ", figure.name);
            let stated = section.lines().find_map(|line| line.strip_prefix(&row));
            let stated = stated.and_then(|rest| rest.split(" |").next());
            let number = stated.and_then(|text| text.replace(',', "").parse::<f64>().ok());
            match (number, figure.value(measured)) {
                (Some(stated), Some(now)) if figure.agree(stated, now) => None,
                (Some(_), None) if figure.optional => None,
                (_, now) => {
                    let (title, name, page) =
                        (&self.title, &figure.name, stated.unwrap_or("nothing"));
                    let now = now.map_or("nothing".to_owned(), |now| grouped(now, figure.decimals));
                    Some(format!(
                        "{title}, {name}: the page states {page}, this run measured {now}"
                    ))
                }
            }
        });
        differences.flatten().collect()
    }
}

impl Figure {
    fn value(&self, measured: &Value) -> Option<f64> {
        Some(measured.pointer(&self.pointer)?.as_f64()? * self.scale.unwrap_or(1.0))
    }

    /// Returns whether `now` equals the value on the page within the tolerance and the page's
    /// rounding.
    fn agree(&self, stated: f64, now: f64) -> bool {
        let digits = i32::try_from(self.decimals).unwrap_or(i32::MAX);
        (stated - now).abs() <= now.abs() * self.tolerance + 0.5001 * 10_f64.powi(-digits)
    }
}

/// Formats a number with commas between groups of three digits: "1,224,652", "-1,000.50".
fn grouped(value: f64, decimals: usize) -> String {
    let mut number = format!("{value:.decimals$}");
    let first_digit = usize::from(value < 0.0);
    let mut comma = number.find('.').unwrap_or(number.len());
    while comma > first_digit + 3 {
        comma -= 3;
        number.insert(comma, ',');
    }
    number
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn section() -> Section {
        let text = r#"
            title = "Encoder"
            command = "bench encoder"
            note = "The checked-in model."
            figure = [
                { name = "instructions per code", pointer = "/machines/0/insn", tolerance = 0.001 },
                { name = "worst step", pointer = "/ns", unit = "ms", scale = 1e-6, decimals = 2, tolerance = 0.1 },
                { name = "cycles", pointer = "/cycles", optional = true },
            ]"#;
        toml::from_str(text).expect("a section")
    }

    #[test]
    fn a_page_agrees_with_the_run_that_wrote_it_and_names_what_differs_from_another() {
        let measured = json!({"machines": [{"insn": 1_000_000}], "ns": 3_030_200, "cycles": 7});
        let page = section().markdown(&measured, "commit abc").expect("figures");
        let rows = "| instructions per code | 1,000,000 |  |\n| worst step | 3.03 | ms |\n";
        assert!(page.contains(rows), "{page}");
        assert_eq!(section().differences(&page, &measured), [""; 0]);
        // Only the number of instructions must be reported: the time has changed by 6 %, less than
        // its tolerance, and the cycles are optional.
        let later = json!({"machines": [{"insn": 1_002_000}], "ns": 3_200_000});
        let expected = "Encoder, instructions per code: the page states 1,000,000, this run measured 1,002,000";
        assert_eq!(section().differences(&page, &later), [expected]);
    }

    #[test]
    fn a_figure_that_was_not_measured_is_missing_and_not_zero() {
        let measured = json!({"machines": [], "ns": null});
        let missing = section().markdown(&measured, "");
        let expected = "its object lacks: instructions per code";
        assert_eq!(missing.err().as_deref(), Some(expected));
        assert_eq!(section().differences("", &measured).len(), 3);
    }

    #[test]
    fn digits_are_in_groups_of_three() {
        let numbers = [(1_095_740.0, 0), (-1_000.5, 2), (-100.0, 0), (56.0, 1)];
        let formatted = numbers.map(|(value, decimals)| grouped(value, decimals));
        assert_eq!(formatted, ["1,095,740", "-1,000.50", "-100", "56.0"]);
    }
}
