//! Builds Rust source text line by line.

use std::fmt::{Display, Write as _};

use super::number::separated;

/// Rust source that has been written so far.
#[derive(Default)]
pub(super) struct Source {
    pub(super) text: String,
}

impl Source {
    /// Appends an item with its doc comment, and an empty line.
    pub(super) fn item(&mut self, doc: &str, line: impl Display) {
        for doc in doc.lines() {
            self.line(format_args!("/// {doc}"));
        }
        self.line(line);
        self.line("");
    }

    /// Appends an array of integers with its doc comment; the integers get digit separators.
    pub(super) fn array<T: Display>(&mut self, doc: &str, declaration: &str, values: &[T]) {
        let values: Vec<String> = values.iter().map(separated).collect();
        self.list(doc, declaration, &values);
    }

    /// Appends an array of formatted values with its doc comment.
    pub(super) fn list(&mut self, doc: &str, declaration: &str, values: &[String]) {
        self.line(format_args!("/// {doc}"));
        self.line(format_args!("{declaration} = ["));
        self.wrapped(values);
        self.line("];");
        self.line("");
    }

    /// Appends comma-separated values in lines of at most 100 characters.
    pub(super) fn wrapped(&mut self, values: &[String]) {
        let mut row = String::from("   ");
        for value in values {
            if row.len() + value.len() + 2 > 100 {
                self.line(&row);
                row.truncate(3);
            }
            let _ = write!(row, " {value},");
        }
        self.line(&row);
    }

    pub(super) fn line(&mut self, line: impl Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{line}");
    }
}
