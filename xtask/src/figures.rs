//! Figures that tests append, as lines of JSON, to the file named by `CORTICODE_FIGURES`. This
//! module reads that file, and prints the figures as one object or as tables.

use std::collections::BTreeMap;
use std::fs;
use std::io::stderr;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Map, Value};

use crate::command::{Failure, OrFail, print, target_folder};
use crate::docs;

/// Figures of one machine, of one board or of a whole run: name and value.
pub(crate) type Row = Map<String, Value>;

/// Rows by the name of machine or board; the row without a name belongs to the whole run.
pub(crate) type Figures = BTreeMap<String, Row>;

/// Makes the tests of `command` write their figures to a new file for `verb`, and returns its path.
/// With `json`, redirects their stdout to stderr, so that stdout holds only the JSON object.
pub(crate) fn attach(command: &mut Command, verb: &str, json: bool) -> PathBuf {
    // Removing fails if no earlier run left a file, which is no error. A test that cannot write the
    // file reports this.
    let _ = fs::remove_file(file(verb));
    if json {
        command.stdout(stderr());
    }
    attach_again(command, verb)
}

/// Makes the tests of `command` append their figures to the file for `verb`, which an earlier
/// command has created. Returns the path of the file.
pub(crate) fn attach_again(command: &mut Command, verb: &str) -> PathBuf {
    let file = file(verb);
    command.env("CORTICODE_FIGURES", &file);
    file
}

fn file(verb: &str) -> PathBuf {
    target_folder().join(format!("{verb}-figures.jsonl"))
}

/// Reads a file of figures and merges its lines by their member `subject`. Returns no figures if
/// the file does not exist, because a run that fails early writes none.
///
/// # Errors
/// A line is not a JSON object.
pub(crate) fn read(file: &Path, subject: &str) -> Result<Figures, Failure> {
    let text = fs::read_to_string(file).unwrap_or_default();
    merged(&text, subject).or_fail(format!("reading {}", file.display()), "run the verb again")
}

/// Merges the lines of `text`, each a JSON object, into one row for each value of their member
/// `subject`, such as "machine". If a figure occurs twice, the later value counts.
fn merged(text: &str, subject: &str) -> Result<Figures, serde_json::Error> {
    let mut figures = Figures::new();
    for line in text.lines() {
        let line: Row = serde_json::from_str(line)?;
        let name = line.get(subject).and_then(Value::as_str).unwrap_or("");
        figures.entry(name.to_owned()).or_default().extend(line);
    }
    Ok(figures)
}

/// Prints the figures of a run, as one JSON object or as one table for each row and one for
/// `whole`. Also saves the object for docs/figures.md. The object has the members of `whole` and
/// the list of rows, named after `subject` in the plural, such as "machines".
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
            print(table(row[subject].as_str().unwrap_or_default(), row))?;
        }
        print(table(&format!("all {list}"), &whole))?;
    }
    whole.insert(list, rows.into());
    let object = Value::Object(whole);
    if json {
        print(format_args!("{object}\n"))?;
    }
    docs::save(verb, &object)
}

/// Returns one figure per line, including those inside objects and lists.
fn table(title: &str, row: &Row) -> String {
    let lines = row.iter().map(|(key, value)| lines(key, value));
    format!("\n{title}\n{}", lines.collect::<String>())
}

fn lines(key: &str, value: &Value) -> String {
    match value {
        Value::Object(members) => {
            members.iter().map(|(name, value)| lines(&format!("{key}.{name}"), value)).collect()
        }
        Value::Array(items) if items.iter().any(Value::is_object) => {
            (0..).zip(items).map(|(place, item)| lines(&format!("{key}.{place}"), item)).collect()
        }
        value => format!("  {key:<48} {value}\n"),
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
