//! Runs a board and a bridge without ROS; the bridge prints its messages as JSON lines.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use rustix::process::Signal;
use serde_json::Value;

use crate::process::{Process, SLACK};
use crate::programs::programs;

/// `NAME` in `NAME.out` and `NAME.err`, the output files of the bridge that [`print()`] starts.
const PRINTING: &str = "printing";

/// Starts `host-sim run` with synthetic EEG and further `options`; its output goes to the files
/// `board.out` and `board.err` in `folder`.
///
/// # Panics
/// When host-sim does not start.
pub fn board_with(folder: &Path, output: &str, options: &[&str]) -> Process {
    let mut board = Command::new(&programs().host_sim);
    board.args(["run", "--input=synthetic", "--output", output]);
    Process::start("board", board.args(options), folder).expect("host-sim starts")
}

/// Starts a board in real time with `seconds` of synthetic EEG with seed 7.
///
/// # Panics
/// When host-sim does not start.
pub fn board(folder: &Path, seconds: usize, output: &str) -> Process {
    let duration = format!("--duration={seconds}");
    board_with(folder, output, &["--seed=7", "--realtime", &duration])
}

/// Starts `corticode-bridge`; its output goes to the files `NAME.out` and `NAME.err` in `folder`,
/// and the models that it fits to the folder `data` there.
///
/// # Panics
/// When the bridge does not start.
pub fn bridge(folder: &Path, name: &str, arguments: &[&str]) -> Process {
    let mut bridge = Command::new(&programs().bridge);
    bridge
        .args(arguments)
        .env("CORTICODE_CONFIG", "/dev/null")
        .env("XDG_DATA_HOME", folder.join("data"));
    Process::start(name, &mut bridge, folder).expect("the bridge starts")
}

/// Starts a bridge with further `options` that prints the messages of the board at `port`.
pub fn print(folder: &Path, port: &str, options: &[&str]) -> Process {
    let arguments = [&["--sink=ndjson", "--port", port], options].concat();
    bridge(folder, PRINTING, &arguments)
}

/// Ends a bridge that [`print()`] has started. Returns its standard output and standard error.
///
/// # Panics
/// When the bridge does not end cleanly.
pub fn stop(bridge: Process, folder: &Path) -> [String; 2] {
    let log = bridge.errors();
    let status = bridge.stop(Signal::TERM, SLACK);
    assert!(status.success(), "{log}");
    ["out", "err"].map(|end| {
        let file = folder.join(PRINTING).with_extension(end);
        fs::read_to_string(file).expect("its output")
    })
}

/// Returns the messages of `topic` among the JSON lines that a bridge has printed, without a last
/// line that it is still writing.
///
/// # Panics
/// When a line with the topic's name is not JSON.
pub fn messages<'l>(lines: &'l str, topic: &str) -> impl Iterator<Item = Value> + use<'l> {
    let topic = format!("\"{topic}\"");
    let whole = lines.rfind('\n').map_or("", |end| &lines[..end]);
    let lines = whole.lines().filter(move |line| line.contains(&topic));
    lines.map(|line| serde_json::from_str::<Value>(line).expect("JSON")["message"].take())
}

/// Returns the values of a block of a printed frame, such as `eeg`.
///
/// # Panics
/// When the frame has no such block.
pub fn values(frame: &Value, block: &str) -> Vec<f32> {
    let data = frame[block]["data"].as_array().expect("a list").iter();
    #[expect(clippy::cast_possible_truncation, reason = "printed from a float32")]
    let values = data.map(|value| value.as_f64().expect("a number") as f32);
    values.collect()
}

/// Returns the statuses `corticode: NAME` in the diagnostics that a bridge has printed.
pub fn statuses(lines: &str, name: &str) -> impl Iterator<Item = Value> {
    let name = format!("corticode: {name}");
    let reports = messages(lines, "/diagnostics");
    let statuses = reports.filter_map(|report| report["status"].as_array().cloned());
    let statuses = statuses.flatten();
    statuses.filter(move |status| status["name"] == name.as_str())
}

/// Returns the value under `key` in a status, as text; `None` if the status has no such value.
pub fn figure<'s>(status: &'s Value, key: &str) -> Option<&'s str> {
    let mut values = status["values"].as_array()?.iter();
    values.find(|value| value["key"] == key)?["value"].as_str()
}

/// Runs a board for `seconds` and records its bytes with a bridge that has `options`. Replays the
/// recording with a second bridge to a third, which prints messages. Converts the recording to
/// tables. Returns the logs of the first and of the second bridge, and what the third printed.
///
/// # Panics
/// When a program fails.
pub fn record_and_replay(
    folder: &Path,
    seconds: usize,
    options: &[&str],
    print_options: &[&str],
) -> [String; 3] {
    let port = folder.join("board").display().to_string();
    let file = folder.join("run.wire").display().to_string();
    let arguments = [&["record", &file, "--port", &port], options].concat();
    let recording = bridge(folder, "recording", &arguments);
    let ended = board(folder, seconds, &format!("pty:{port}")).wait(SLACK);
    assert!(ended.success());
    // Give the recorder a second to receive the last bytes.
    std::thread::sleep(Duration::from_secs(1));
    assert!(recording.stop(Signal::INT, SLACK).success());
    let log = fs::read_to_string(folder.join("recording.err")).expect("a log");

    let output = format!("pty:{port}");
    let mut replaying = bridge(folder, "replaying", &["replay", &file, "--output", &output]);
    replaying.wait_until("a port", SLACK, |_| Path::new(&port).exists());
    let printing = print(folder, &port, print_options);
    assert!(replaying.wait(SLACK).success(), "{}", replaying.log());
    let [printed, _] = stop(printing, folder);

    let mut converting = bridge(folder, "converting", &["convert", &file, "--to=csv"]);
    assert!(converting.wait(SLACK).success(), "{}", converting.log());
    [log, replaying.log(), printed]
}
