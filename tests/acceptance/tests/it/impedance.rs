//! Impedances of a board's electrodes reach the user: as a table, as JSON, as a picture, on
//! `/diagnostics`, and through a recording and its replay.

use std::fs;
use std::path::Path;

use acceptance::port::free_address;
use acceptance::printing::{self, board_with, bridge, figure};
use acceptance::process::{Process, SLACK};
use serde_json::Value;

/// Starts a board with Pz disconnected, 40 kOhm at Cz, and 5 kOhm at every other electrode. Returns
/// the board and its port.
fn board(folder: &Path) -> (Process, String) {
    let port = free_address();
    let contacts = ["--impedance=40k:Cz", "--fault=lead-off:Pz"];
    let options = [&["--realtime", "--duration=120"], &contacts[..]].concat();
    (board_with(folder, &port, &options), port)
}

/// Returns the newest status `impedance` among the printed diagnostics.
fn status(lines: &str) -> Option<Value> {
    printing::statuses(lines, "impedance").last()
}

/// Asserts that the status has the impedances of [`board`].
fn assert_named(status: &Value) {
    assert_eq!(status["message"], "open: Pz; 20 kOhm or more: Cz");
    assert_eq!(figure(status, "Pz"), Some("open"));
    for (label, kohm) in [("Fz", 5.0), ("Cz", 40.0)] {
        let text = figure(status, label).expect("an electrode");
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
    let arguments = ["impedance", "--port", &port, "--measurements=2", "--picture", picture_text];
    let mut table = bridge(folder, "table", &arguments);
    assert!(table.wait(SLACK).success(), "{}", table.log());
    let text = table.output();
    assert!(text.contains("Pz   open"), "{text}");
    assert!(fs::read_to_string(&picture).expect("a picture").contains("Pz open"));
    // If the file of the picture exists, the bridge refuses the command before it measures
    // anything.
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
    printing.wait_until("an impedance", SLACK, |bridge| status(&bridge.output()).is_some());
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
