//! Figures that tests append as JSON lines to the file named by `CORTICODE_FIGURES`.
//!
//! A line is an object: figures of one machine or board, which a member names, or figures of the whole run.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use serde_json::{Map, Value};

use crate::command::{Failure, target_folder};

/// Figures by key.
pub(crate) type Row = Map<String, Value>;

/// File of one run.
#[derive(Debug)]
pub(crate) struct File(PathBuf);

impl File {
    /// A fresh file for `verb`: a run must not show figures of the run before.
    pub(crate) fn new(verb: &str) -> Self {
        let file = target_folder().join(format!("{verb}-figures.jsonl"));
        // Fails where there is nothing to remove; a file that stays is reported by the tests, which write it.
        let _ = fs::remove_file(&file);
        Self(file)
    }

    /// Lets the tests of a command write to the file; `json` keeps standard output free for the object.
    pub(crate) fn attach<'c>(&self, command: &'c mut Command, json: bool) -> &'c mut Command {
        if json {
            command.stdout(std::io::stderr());
        }
        command.env("CORTICODE_FIGURES", &self.0)
    }

    /// Reads and merges all lines; none without a file, which a run that fails early does not write.
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
    /// Figures of the whole run.
    pub(crate) whole: Row,
    /// Figures by machine or board.
    pub(crate) rows: BTreeMap<String, Row>,
}

impl Figures {
    /// Merges lines by their member `subject`, "machine" for example. The last figure of a name wins.
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

/// Prints one figure per line, the figures in objects and lists included.
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
