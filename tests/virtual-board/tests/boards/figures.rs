//! Figures for whoever runs the tests, as lines of JSON in the file that `CORTICODE_FIGURES` names.

use std::env;
use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;

use crate::images::Subject;

/// Writes a figure down: a number or a truth value.
pub(crate) fn record(subject: Subject, key: &str, value: impl Display) {
    println!("{subject}: {key} {value}");
    let Some(path) = env::var_os("CORTICODE_FIGURES") else {
        return;
    };
    let file = OpenOptions::new().append(true).create(true).open(path);
    let board = subject.key();
    // One write: tests run side by side.
    let line = format!("{{\"board\":\"{board}\",\"{key}\":{value}}}\n");
    let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
    written.expect("the file of CORTICODE_FIGURES can be written");
}
