//! Records measured figures as JSON lines in the file that `CORTICODE_FIGURES` names.

use std::env;
use std::fs::OpenOptions;
use std::io::Write;

use serde::Serialize;

/// Environment variable that names the file to which figures are appended.
pub const FILE: &str = "CORTICODE_FIGURES";

/// Prints figures as one JSON object. If the variable [`FILE`] is set, also appends the object as a
/// line to the file that it names.
///
/// The object has the keys of `figures`, which must be a map or a struct, and the key `machine`
/// unless the argument `machine` is `None`.
///
/// # Panics
/// When `figures` has no keys, or the file cannot be written.
pub fn record(machine: Option<&str>, figures: &impl Serialize) {
    let mut line = serde_json::to_value(figures).expect("figures are a map with text keys");
    if let Some(machine) = machine {
        line["machine"] = machine.into();
    }
    let line = format!("{line}\n");
    print!("{line}");
    let Some(path) = env::var_os(FILE) else {
        return;
    };
    let file = OpenOptions::new().append(true).create(true).open(path);
    // Write the line in one call, so that tests which run in parallel do not mix their lines.
    let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
    written.expect("the file named by CORTICODE_FIGURES is writable");
}
