//! Impedances of a board's electrodes reach the user: as a table, as JSON, as a picture, on
//! `/diagnostics`, and through a recording and its replay.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use acceptance::port::free_port;
use acceptance::printing::{self, bridge};
use acceptance::process::Process;
use acceptance::programs::programs;
use serde_json::Value;

/// Time limit for a condition, enough on a busy machine.
const SLACK: Duration = Duration::from_mins(1);

/// Starts a board with 5 kOhm at every electrode, 40 kOhm at Cz, and Pz off. Returns the board and
/// its port.
fn board(folder: &Path) -> (Process, String) {
    let port = format!("tcp:127.0.0.1:{}", free_port().expect("a free port"));
    let mut board = Command::new(&programs().host_sim);
    board.args(["run", "--input=synthetic", "--realtime", "--duration=120"]);
    board.args(["--impedance=40k:Cz", "--fault=lead-off:Pz"]);
    board.args(["--output", &port]);
    let board = Process::start("board", &mut board, folder).expect("host-sim starts");
    (board, port)
}

/// Returns the newest status `impedance` among the printed diagnostics.
fn status(lines: &str) -> Option<Value> {
    let reports = printing::messages(lines, "/diagnostics");
    let statuses = reports.filter_map(|report| report["status"].as_array().cloned());
    let is_wanted = |status: &Value| status["name"] == "corticode: impedance";
    statuses.flatten().filter(is_wanted).last()
}

/// Returns the value of an electrode in a status.
fn value<'s>(status: &'s Value, label: &str) -> &'s str {
    let values = status["values"].as_array().expect("a list");
    let value = values.iter().find(|value| value["key"] == label);
    value.expect("an electrode")["value"]
        .as_str()
        .expect("text")
}

/// Asserts that the status names the electrodes of [`board`].
fn assert_named(status: &Value) {
    assert_eq!(status["message"], "open: Pz; 20 kOhm or more: Cz");
    assert_eq!(value(status, "Pz"), "open");
    for (label, kohm) in [("Fz", 5.0), ("Cz", 40.0)] {
        let text = value(status, label);
        let number = text.strip_suffix(" kOhm").expect("kilohms");
        let measured: f64 = number.parse().expect("a number");
        assert!((measured / kohm - 1.0).abs() < 0.05, "{label}: {text}");
    }
}

#[test]
fn the_impedances_of_a_board_are_shown_as_table_json_and_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (_board, port) = board(folder);
    let picture = folder.join("head.svg");
    let picture_text = picture.to_str().expect("text");
    let arguments = [
        "impedance",
        "--port",
        &port,
        "--measurements=2",
        "--picture",
        picture_text,
    ];
    let mut table = bridge(folder, "table", &arguments);
    assert!(table.wait(SLACK).success(), "{}", table.log());
    let text = table.output();
    assert!(text.contains("Pz   open"), "{text}");
    assert!(
        fs::read_to_string(&picture)
            .expect("a picture")
            .contains("Pz open")
    );
    // An existing picture is refused before anything is measured.
    let mut refused = bridge(folder, "refused", &arguments);
    assert_eq!(refused.wait(SLACK).code(), Some(2), "{}", refused.log());

    let arguments = ["impedance", "--port", &port, "--measurements=1", "--json"];
    let mut json = bridge(folder, "json", &arguments);
    assert!(json.wait(SLACK).success(), "{}", json.log());
    let report: Value = serde_json::from_str(json.output().trim()).expect("one line of JSON");
    let electrodes = report["electrodes"].as_array().expect("a list");
    let of = |label: &str| electrodes.iter().find(|one| one["electrode"] == label);
    assert_eq!(of("Pz").expect("Pz")["contact"], "open");
    assert_eq!(of("Cz").expect("Cz")["contact"], "bad");
    let ohms = of("Fz").expect("Fz")["ohms"].as_f64().expect("ohms");
    assert!((ohms / 5000.0 - 1.0).abs() < 0.05, "{ohms}");
}

#[test]
fn impedances_are_on_diagnostics_while_codes_stream() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (board, port) = board(folder);
    let mut printing = printing::print(folder, &port, &["--impedance"]);
    printing.wait_until("an impedance", SLACK, |bridge| {
        status(&bridge.output()).is_some()
    });
    let [lines, log] = printing::stop(printing, folder);
    assert_named(&status(&lines).expect("a status"));
    assert!(printing::messages(&lines, "/encoded").count() > 0, "{log}");

    drop(board);
}

#[test]
fn impedances_survive_a_recording_and_its_replay() {
    let folder = tempfile::tempdir().expect("a folder");
    let [_, _, printed] = printing::record_and_replay(folder.path(), 6, &["--impedance"], &[]);
    let status = status(&printed).expect("a status");
    let electrodes = status["values"].as_array().expect("a list").len();
    let words = format!("{electrodes} electrodes below 20 kOhm");
    assert_eq!(status["message"], words.as_str());
}
