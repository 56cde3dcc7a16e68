//! Measured figures, as JSON lines in the file that `CORTICODE_FIGURES` names.

use std::env;
use std::fs::OpenOptions;
use std::io::Write;

use serde::Serialize;

/// Environment variable with the path of the file.
pub const FILE: &str = "CORTICODE_FIGURES";

/// One line of the file.
#[derive(Debug, Serialize)]
struct Line<'f, F> {
    #[serde(skip_serializing_if = "Option::is_none")]
    machine: Option<&'f str>,
    #[serde(flatten)]
    figures: &'f F,
}

/// Prints a line of figures, and appends it to the file where [`FILE`] names one. The figures are a map or a
/// struct; their keys stand next to `machine`, which is left out where the figures are those of no machine.
///
/// # Panics
/// The figures cannot be written.
pub fn record(machine: Option<&str>, figures: &impl Serialize) {
    let line = Line { machine, figures };
    let line = serde_json::to_string(&line).expect("figures are a map with text keys") + "\n";
    print!("{line}");
    let Some(path) = env::var_os(FILE) else {
        return;
    };
    let file = OpenOptions::new().append(true).create(true).open(path);
    // One write, so that lines of parallel tests stay whole.
    let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
    written.expect("the file named by CORTICODE_FIGURES is writable");
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
        let text = |machine| {
            let figures = &Codes { codes: 7 };
            serde_json::to_string(&Line { machine, figures }).expect("JSON")
        };
        assert_eq!(text(Some("m")), r#"{"machine":"m","codes":7}"#);
        assert_eq!(text(None), r#"{"codes":7}"#);
    }
}
