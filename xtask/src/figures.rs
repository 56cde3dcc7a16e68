//! Figures of a run: read from the lines of JSON that its tests append to the file named by
//! `CORTICODE_FIGURES`, and printed as one object or as tables.

use std::collections::BTreeMap;
use std::fs;
use std::io::stderr;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Map, Value};

use crate::command::{Failure, OrFail, target_folder};
use crate::docs;

/// Figures of one machine, board or run, by name.
pub(crate) type Row = Map<String, Value>;

/// Figures of each machine or board, by its name, and those of the whole run under an empty name.
pub(crate) type Figures = BTreeMap<String, Row>;

/// Makes the tests of a command write to a new file for `verb`, and returns the file. With `json`, the
/// command's own output goes to stderr, which leaves stdout to the JSON object.
pub(crate) fn attach(command: &mut Command, verb: &str, json: bool) -> PathBuf {
    let file = target_folder().join(format!("{verb}-figures.jsonl"));
    // Fails if there is no file of an earlier run. If an old file stays, the tests that write it report an error.
    let _ = fs::remove_file(&file);
    if json {
        command.stdout(stderr());
    }
    command.env("CORTICODE_FIGURES", &file);
    file
}

/// Reads and merges all lines of a file. Returns no figures without a file: a run that fails early writes
/// none.
///
/// # Errors
/// A line is not a JSON object.
pub(crate) fn read(file: &Path, subject: &str) -> Result<Figures, Failure> {
    let text = fs::read_to_string(file).unwrap_or_default();
    merged(&text, subject).or_fail(format!("reading {}", file.display()), "run the verb again")
}

/// Merges lines by their member `subject`, such as "machine". If a figure occurs twice, the last one counts.
fn merged(text: &str, subject: &str) -> Result<Figures, serde_json::Error> {
    let mut figures = Figures::new();
    for line in text.lines() {
        let line: Row = serde_json::from_str(line)?;
        let name = line.get(subject).and_then(Value::as_str).unwrap_or("");
        figures.entry(name.to_owned()).or_default().extend(line);
    }
    Ok(figures)
}

/// Prints the object of a run: as JSON, or as one table for each row and one for the whole run. Also saves it
/// for docs/figures.md. The object has the members of `whole`, and the rows in a list that is named after their
/// `subject`, such as "machines".
///
/// # Errors
/// The object cannot be saved.
pub(crate) fn publish(
    verb: &str,
    subject: &str,
    rows: Vec<Row>,
    mut whole: Row,
    json: bool,
) -> Result<(), Failure> {
    let list = format!("{subject}s");
    if !json {
        for row in &rows {
            print_table(row[subject].as_str().unwrap_or_default(), row);
        }
        print_table(&format!("all {list}"), &whole);
    }
    whole.insert(list, rows.into());
    let object = Value::Object(whole);
    if json {
        println!("{object}");
    }
    docs::save(verb, &object)
}

/// Prints one figure per line, including the figures inside objects and lists.
fn print_table(title: &str, row: &Row) {
    println!("\n{title}");
    row.iter().for_each(|(key, value)| print_value(key, value));
}

fn print_value(key: &str, value: &Value) {
    match value {
        Value::Object(members) => members
            .iter()
            .for_each(|(name, value)| print_value(&format!("{key}.{name}"), value)),
        Value::Array(items) if items.iter().any(Value::is_object) => items
            .iter()
            .enumerate()
            .for_each(|(place, item)| print_value(&format!("{key}.{place}"), item)),
        value => println!("  {key:<48} {value}"),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn lines_are_merged_by_their_subject_and_the_rest_belongs_to_the_whole_run() {
        let text = r#"{"machine":"a","codes":1}
{"inputs":["EEG"]}
{"machine":"b","codes":2}
{"machine":"a","storm":{"codes":3}}"#;
        let figures = merged(text, "machine").expect("figures");
        let expected = json!({
            "": {"inputs": ["EEG"]},
            "a": {"machine": "a", "codes": 1, "storm": {"codes": 3}},
            "b": {"machine": "b", "codes": 2},
        });
        assert_eq!(json!(figures), expected);
        assert!(merged("no JSON", "machine").is_err());
    }
}
