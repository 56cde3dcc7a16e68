//! `cargo xtask qemu`: runs the application on emulated microcontrollers in virtual time and compares it with
//! host-sim.

use serde_json::{Value, json};

use crate::command::{Failure, cargo, run};
use crate::docs;
use crate::figures::{self, Figures, File, Row};
use crate::install;

/// Runs the scenarios on emulated microcontrollers and prints their figures.
///
/// # Errors
/// The target is missing, or a scenario fails.
pub(crate) fn qemu(codes: u32, json: bool) -> Result<(), Failure> {
    install::board_target()?;
    let file = File::new("qemu");
    let mut test = cargo("test --package emulated --no-fail-fast");
    file.attach(&mut test, json)
        .env("CORTICODE_CODES", codes.to_string());
    let next = "run the failed scenario alone: `cargo test --package emulated --test SCENARIO`";
    let passed = run(&mut test, next);
    print(&file, json, passed.as_ref().err())?;
    passed
}

/// Prints the figures of a run as one JSON object or as a table.
///
/// # Errors
/// A line of the file is not a JSON object.
pub(crate) fn print(file: &File, json: bool, failure: Option<&Failure>) -> Result<(), Failure> {
    let Figures { mut whole, rows } = file.read("machine")?;
    whole.extend(summary(&rows.values().collect::<Vec<_>>()));
    whole.insert(
        "faults".to_owned(),
        failure.map(ToString::to_string).into_iter().collect(),
    );
    let machines = rows.iter().map(|(name, row)| {
        let mut row = row.clone();
        row.insert("machine".to_owned(), name[..].into());
        Value::Object(row)
    });
    let mut object = whole.clone();
    object.insert("machines".to_owned(), machines.collect());
    let object = Value::Object(object);
    docs::save("qemu", &object)?;
    if json {
        println!("{object}");
        return Ok(());
    }
    println!("The application on emulated microcontrollers, in virtual time (simulated)");
    for (name, row) in &rows {
        figures::print_table(name, row);
    }
    figures::print_table("all machines", &whole);
    Ok(())
}

/// Returns figures over all machines: the least, sum or worst. A truth value holds if it holds on each
/// machine.
fn summary(rows: &[&Row]) -> Row {
    let figure = |path: &'static str| rows.iter().map(move |row| at(row, path));
    let all = |path, wanted: Value| {
        figure(path).next().is_some() && figure(path).all(|value| *value == wanted)
    };
    let count = |path| figure(path).filter_map(Value::as_u64);
    let worst = |path| {
        let stages = figure(path).filter_map(Value::as_array).flatten();
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

/// Returns the value at a path of keys, such as `/all_streams/equal`; null if there is none.
fn at<'r>(row: &'r Row, path: &str) -> &'r Value {
    let mut keys = path.split('/').skip(1);
    let first = keys.next().and_then(|key| row.get(key));
    keys.fold(first.unwrap_or(&Value::Null), |value, key| &value[key])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_has_the_worst_of_all_machines_and_a_run_without_figures_is_equal_to_nothing() {
        let row = |codes: u64, worst: u64, equal: bool| {
            let row = json!({
                "codes": codes, "different_codes": 0, "different_reports": 0, "repeatable": true, "overruns": 1,
                "stages": {"stages": [{"worst_ns": worst, "deadline_ns": 8}]},
                "all_streams": {"equal": equal, "stages": {"stages": [{"worst_ns": 6, "deadline_ns": 8}]}},
            });
            row.as_object().cloned().expect("an object")
        };
        let rows = [row(1000, 2, true), row(999, 4, false)];
        let expected = json!({
            "codes": 999, "equal_to_host": true, "streams_equal": false, "repeatable": true, "overruns": 2,
            "worst_path_over_deadline": 0.5, "worst_path_all_streams": 0.75,
        });
        assert_eq!(json!(summary(&[&rows[0], &rows[1]])), expected);
        let none = summary(&[]);
        assert_eq!(
            [&none["equal_to_host"], &none["repeatable"]],
            [&json!(false); 2]
        );
    }
}
