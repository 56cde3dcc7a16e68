//! `cargo xtask qemu`: runs the application on emulated microcontrollers in virtual time and
//! compares it with host-sim.

use std::path::Path;

use serde_json::{Value, json};

use crate::command::{Failure, cargo, print, run};
use crate::figures::{self, Row};
use crate::install;

/// Runs the scenarios on emulated microcontrollers and prints their figures.
pub(crate) fn qemu(codes: u32, json: bool) -> Result<(), Failure> {
    install::board_target()?;
    let mut test = cargo("test --package emulated --no-fail-fast");
    let file = figures::attach(&mut test, "qemu", json);
    test.env("CORTICODE_CODES", codes.to_string());
    let next = "run the failed scenario alone: `cargo test --package emulated SCENARIO::`";
    let passed = run(&mut test, next);
    report(&file, passed.as_ref().err(), json)?;
    passed
}

/// Prints the figures in `file`, and the message of `failure` among them, as one JSON object or as
/// tables.
///
/// # Errors
/// A line of the file is not a JSON object.
pub(crate) fn report(file: &Path, failure: Option<&Failure>, json: bool) -> Result<(), Failure> {
    if !json {
        print("The application on emulated microcontrollers, in virtual time (simulated)\n")?;
    }
    let mut figures = figures::read(file, "machine")?;
    let mut whole = figures.remove("").unwrap_or_default();
    let machines: Vec<Row> = figures.into_values().collect();
    whole.append(&mut summary(&json!(machines)));
    let faults = failure.map(|failure| &failure.message[..]);
    whole.insert("faults".to_owned(), faults.into_iter().collect());
    figures::publish("qemu", "machine", machines, whole, json)
}

/// Returns figures that summarise all machines: the smallest value, the sum or the worst value of
/// each figure. A truth value is true if it is true on every machine.
fn summary(machines: &Value) -> Row {
    let machines = || machines.as_array().into_iter().flatten();
    let figure = |pointer: &'static str| machines().filter_map(move |row| row.pointer(pointer));
    let all = |pointer, wanted: Value| {
        let holding = figure(pointer).filter(|value| **value == wanted).count();
        holding > 0 && holding == machines().count()
    };
    let count = |pointer| figure(pointer).filter_map(Value::as_u64);
    let worst = |pointer| {
        let stages = figure(pointer).filter_map(Value::as_array).flatten();
        let over = stages
            .filter_map(|stage| Some(stage["worst_ns"].as_f64()? / stage["deadline_ns"].as_f64()?));
        over.reduce(f64::max)
    };
    let summary = json!({
        "codes": count("/codes").min().unwrap_or(0),
        "equal_to_host": all("/different_codes", 0.into()) && all("/different_reports", 0.into()),
        "streams_equal": all("/all_streams/equal", true.into()),
        "repeatable": all("/repeatable", true.into()),
        "overruns": count("/overruns").sum::<u64>(),
        "worst_path_over_deadline": worst("/stages/stages"),
        "worst_path_all_streams": worst("/all_streams/stages/stages"),
    });
    summary.as_object().cloned().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_has_the_worst_of_all_machines_and_a_run_without_figures_is_equal_to_nothing() {
        let row = |codes: u64, worst: u64, equal: bool| {
            json!({
                "codes": codes, "different_codes": 0, "different_reports": 0, "repeatable": true, "overruns": 1,
                "stages": {"stages": [{"worst_ns": worst, "deadline_ns": 8}]},
                "all_streams": {"equal": equal, "stages": {"stages": [{"worst_ns": 6, "deadline_ns": 8}]}},
            })
        };
        let expected = json!({
            "codes": 999, "equal_to_host": true, "streams_equal": false, "repeatable": true, "overruns": 2,
            "worst_path_over_deadline": 0.5, "worst_path_all_streams": 0.75,
        });
        let machines = json!([row(1000, 2, true), row(999, 4, false)]);
        assert_eq!(json!(summary(&machines)), expected);
        let none = summary(&json!([]));
        assert!(none["equal_to_host"] == false && none["repeatable"] == false);
    }
}
