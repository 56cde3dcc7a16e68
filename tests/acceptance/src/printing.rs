//! Runs of a board and a bridge without ROS, in which the bridge prints its messages as JSON lines.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use rustix::process::Signal;
use serde_json::Value;

use crate::process::Process;
use crate::programs::programs;

/// Time limit for a program to exit or to reach a condition, enough on a busy machine.
const SLACK: Duration = Duration::from_mins(1);

/// `NAME` in `NAME.out` and `NAME.err`, the output files of the bridge that [`print`] starts.
const PRINTING: &str = "printing";

/// Starts `host-sim run` in real time with `seconds` of synthetic EEG with seed 7.
///
/// # Panics
/// When host-sim does not start.
pub fn board(folder: &Path, seconds: usize, output: &str) -> Process {
    let mut board = Command::new(&programs().host_sim);
    board
        .args(["run", "--input=synthetic", "--seed=7", "--realtime"])
        .arg(format!("--duration={seconds}"))
        .arg(format!("--output={output}"));
    Process::start("board", &mut board, folder).expect("host-sim starts")
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

/// Ends a bridge that [`print`] has started. Returns its standard output and standard error.
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

/// Returns the messages of `topic` among the JSON lines that a bridge has printed.
///
/// # Panics
/// When a line with the topic's name is not JSON.
pub fn messages<'l>(lines: &'l str, topic: &str) -> impl Iterator<Item = Value> + use<'l> {
    let topic = format!("\"{topic}\"");
    let lines = lines.lines().filter(move |line| line.contains(&topic));
    lines.map(|line| serde_json::from_str::<Value>(line).expect("JSON")["message"].take())
}

/// Runs a board for `seconds`, records its bytes by a bridge with `options`, replays the recording
/// to a bridge that prints messages, and converts it to tables. Returns the first bridge's log, the
/// second's log, and what the second printed.
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
