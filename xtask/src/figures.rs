//! Figures that tests append as JSON lines to the file named by `CORTICODE_FIGURES`.
//!
//! Each line is a JSON object. Its figures belong to the machine or board that one of its members names, or
//! else to the whole run.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use serde_json::{Map, Value};

use crate::command::{Failure, target_folder};

/// Figures of one machine, board or run, by name.
pub(crate) type Row = Map<String, Value>;

/// File to which the tests of one run append their figures.
#[derive(Debug)]
pub(crate) struct File(PathBuf);

impl File {
    /// Returns a new file for `verb` without the figures of the previous run.
    pub(crate) fn new(verb: &str) -> Self {
        let file = target_folder().join(format!("{verb}-figures.jsonl"));
        // Fails if there is no file to remove. If an old file stays, the tests that write it report an error.
        let _ = fs::remove_file(&file);
        Self(file)
    }

    /// Makes the tests of a command write to this file. With `json`, the command's own output goes to stderr,
    /// which leaves stdout to the JSON object.
    pub(crate) fn attach<'c>(&self, command: &'c mut Command, json: bool) -> &'c mut Command {
        if json {
            command.stdout(std::io::stderr());
        }
        command.env("CORTICODE_FIGURES", &self.0)
    }

    /// Reads and merges all lines of the file. Returns no figures without a file: a run that fails early
    /// writes none.
    ///
    /// # Errors
    /// A line is not a JSON object.
    pub(crate) fn read(&self, subject: &str) -> Result<Figures, Failure> {
        let text = fs::read_to_string(&self.0).unwrap_or_default();
        Figures::parse(&text, subject).map_err(|error| {
            Failure::check(
                format!("reading {}", self.0.display()),
                error,
                "run the verb again",
            )
        })
    }
}

/// Merged figures of one run.
#[derive(Debug, Default)]
pub(crate) struct Figures {
    /// Figures that belong to no machine or board.
    pub(crate) whole: Row,
    /// Figures of each machine or board, by its name.
    pub(crate) rows: BTreeMap<String, Row>,
}

impl Figures {
    /// Merges lines by their member `subject`, such as "machine". If a figure occurs twice, the last one
    /// counts.
    pub(crate) fn parse(text: &str, subject: &str) -> Result<Self, serde_json::Error> {
        let mut figures = Self::default();
        for line in text.lines() {
            let mut line: Row = serde_json::from_str(line)?;
            match line.remove(subject) {
                Some(Value::String(name)) => figures.rows.entry(name).or_default().extend(line),
                _ => figures.whole.extend(line),
            }
        }
        Ok(figures)
    }
}

/// Prints one figure per line, including the figures inside objects and lists.
pub(crate) fn print_table(name: &str, row: &Row) {
    println!("\n{name}");
    for (key, value) in row {
        print_value(key, value);
    }
}

fn print_value(key: &str, value: &Value) {
    match value {
        Value::Object(members) => {
            members
                .iter()
                .for_each(|(name, value)| print_value(&format!("{key}.{name}"), value));
        }
        Value::Array(items) if items.iter().any(Value::is_object) => {
            (0..)
                .zip(items)
                .for_each(|(place, item): (usize, _)| print_value(&format!("{key}.{place}"), item));
        }
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
        let figures = Figures::parse(text, "machine").expect("figures");
        assert_eq!(json!(figures.whole), json!({"inputs": ["EEG"]}));
        let rows = json!({"a": {"codes": 1, "storm": {"codes": 3}}, "b": {"codes": 2}});
        assert_eq!(json!(figures.rows), rows);
        assert!(Figures::parse("no JSON", "machine").is_err());
    }
}
