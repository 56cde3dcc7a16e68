//! Measured figures, as JSON lines in the file that `CORTICODE_FIGURES` names.

use std::env;
use std::fs::OpenOptions;
use std::io::Write;

use serde::Serialize;
use serde_json::Value;

/// Environment variable with the path of the file.
pub const FILE: &str = "CORTICODE_FIGURES";

/// Prints a line of figures, and appends it to the file where [`FILE`] names one. The figures are a map or a
/// struct; their keys stand next to `machine`, which is left out where the figures are those of no machine.
///
/// # Panics
/// The figures cannot be written.
pub fn record(machine: Option<&str>, figures: &impl Serialize) {
    let line = line(machine, figures);
    print!("{line}");
    let Some(path) = env::var_os(FILE) else {
        return;
    };
    let file = OpenOptions::new().append(true).create(true).open(path);
    // One write, so that lines of parallel tests stay whole.
    let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
    written.expect("the file named by CORTICODE_FIGURES is writable");
}

fn line(machine: Option<&str>, figures: &impl Serialize) -> String {
    let mut line = serde_json::to_value(figures).expect("figures are a map with text keys");
    if let Some(machine) = machine {
        line["machine"] = Value::from(machine);
    }
    format!("{line}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_names_its_machine_next_to_the_figures() {
        #[derive(Serialize)]
        struct Codes {
            codes: usize,
        }
        let codes = Codes { codes: 7 };
        assert_eq!(line(Some("m"), &codes), "{\"codes\":7,\"machine\":\"m\"}\n");
        assert_eq!(line(None, &codes), "{\"codes\":7}\n");
    }
}
