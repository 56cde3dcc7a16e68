//! The figures of a run, as a table or as one JSON object.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Board;
use crate::failure::Failure;

/// Truth values of a board, and the figures that all have to be there for each.
const VERDICTS: [(&str, &[&str]); 3] = [
    (
        "reset_cause_ok",
        &[
            "reset_cause_hang",
            "reset_cause_panic",
            "reset_cause_fault",
            "reset_cause_overflow",
            "reset_cause_wild_stack",
        ],
    ),
    (
        "faults_named",
        &[
            "fault_dead_chip",
            "fault_late_power",
            "fault_silent_drdy",
            "fault_shifted_bit",
        ],
    ),
    ("bridge_connected", &["bridge_codes", "bridge_selftest"]),
];

/// Figures that every board has, null where its test did not get so far.
const ALWAYS: [&str; 6] = [
    "booted",
    "codes",
    "equal_to_host",
    "violations",
    "unmapped",
    "selftest_ok",
];

/// A line of the tests' file.
#[derive(Debug, Deserialize)]
struct Line {
    board: String,
    key: String,
    value: Value,
}

/// The object of `--json`.
#[derive(Debug, Serialize)]
struct Report {
    boards: Vec<BTreeMap<String, Value>>,
    passed: bool,
}

/// Prints what the tests have written down.
///
/// # Errors
/// A line of the file is no figure.
pub(super) fn print(
    boards: &[Board],
    figures: &Path,
    passed: bool,
    json: bool,
) -> Result<(), Failure> {
    // Without the file no test got so far.
    let text = fs::read_to_string(figures).unwrap_or_default();
    let lines: Result<Vec<Line>, _> = text.lines().map(serde_json::from_str).collect();
    let lines = lines.map_err(|error| Failure::Check {
        what: format!("reading {}", figures.display()),
        why: error.to_string(),
        next: "run the verb again".to_owned(),
    })?;
    let report = Report {
        boards: boards
            .iter()
            .map(|board| row(board.key(), &lines))
            .collect(),
        passed,
    };
    if json {
        let object = serde_json::to_string(&report);
        println!(
            "{}",
            object.unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}"))
        );
        return Ok(());
    }
    for board in &report.boards {
        println!();
        for (key, value) in board {
            println!("{key:<40} {value}");
        }
    }
    Ok(())
}

/// A board's figures; those of its other image have its word before them.
fn row(board: &str, lines: &[Line]) -> BTreeMap<String, Value> {
    let mut row: BTreeMap<String, Value> = ALWAYS.map(|key| (key.to_owned(), Value::Null)).into();
    for line in lines {
        if line.board == board {
            row.insert(line.key.clone(), line.value.clone());
        } else if let Some(word) = line.board.strip_prefix(board) {
            row.insert(
                format!("{}_{}", word.trim_start_matches('-'), line.key),
                line.value.clone(),
            );
        }
    }
    for (verdict, keys) in VERDICTS {
        let holds = keys.iter().all(|key| row.contains_key(*key));
        row.insert(verdict.to_owned(), holds.into());
    }
    row.insert("board".to_owned(), board.into());
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<Line> {
        let lines = text.lines().map(serde_json::from_str);
        lines.collect::<Result<_, _>>().expect("figures")
    }

    #[test]
    fn what_no_test_has_written_down_is_null_and_its_verdict_is_false() {
        let row = row("f446", &[]);
        for key in ALWAYS {
            assert_eq!(row[key], Value::Null, "{key}");
        }
        for (verdict, _) in VERDICTS {
            assert_eq!(row[verdict], Value::from(false), "{verdict}");
        }
    }

    #[test]
    fn a_verdict_needs_all_of_its_figures_and_the_other_images_have_their_word() {
        let some = r#"{"board":"h743","key":"fault_dead_chip","value":true}
{"board":"h743-uart","key":"codes","value":256}
{"board":"f446","key":"codes","value":7}"#;
        let some = lines(some);
        let row = row("h743", &some);
        assert_eq!(row["faults_named"], Value::from(false));
        assert_eq!(
            (&row["codes"], &row["uart_codes"]),
            (&Value::Null, &Value::from(256))
        );
    }
}
