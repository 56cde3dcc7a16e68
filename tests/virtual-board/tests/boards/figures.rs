//! Measured figures, written as lines of JSON to the file that `CORTICODE_FIGURES` names.

use std::env;
use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;

use crate::images::Subject;

/// Prints a figure, and appends it to the file that `CORTICODE_FIGURES` names. `value` is a number or a
/// boolean.
pub(crate) fn record(subject: Subject, key: &str, value: impl Display) {
    println!("{subject}: {key} {value}");
    let Some(path) = env::var_os("CORTICODE_FIGURES") else {
        return;
    };
    let file = OpenOptions::new().append(true).create(true).open(path);
    let board = subject.key;
    // The line is written with a single call, because tests run concurrently.
    let line = format!("{{\"board\":\"{board}\",\"{key}\":{value}}}\n");
    let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
    written.expect("CORTICODE_FIGURES names a writable file");
}
