//! Packed blocks of a replay, printed as lines of JSON.

use std::io::{BufRead, BufReader};
use std::time::Duration;

use link::Streams;
use rustix::process::Signal;
use serde_json::Value;

use crate::board::{Board, assert_has};
use crate::packed_recording::PackedRecording;
use crate::process::Bridge;

/// Replays a recording to a bridge, and returns the bridge's messages with their topics, and its log.
fn messages(recording: PackedRecording) -> (Vec<(String, Value)>, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    std::fs::write(&path, recording.finish()).unwrap();
    let port = folder.path().join("board");
    let output = format!("pty:{}", port.display());
    let replay = Bridge::start(&["replay", path.to_str().unwrap(), "--output", &output]);
    let port = port.to_str().unwrap();
    let arguments = ["--port", port, "--sink", "ndjson", "--streams", "packed"];
    let mut bridge = Bridge::start(&arguments);
    let lines = BufReader::new(bridge.stdout()).lines();
    let reader = std::thread::spawn(move || {
        let messages = lines.map(|line| {
            let mut line: Value = serde_json::from_str(&line.unwrap()).unwrap();
            let topic = line["topic"].as_str().unwrap().to_owned();
            (topic, line["message"].take())
        });
        messages.collect::<Vec<_>>()
    });
    replay.success();
    std::thread::sleep(Duration::from_millis(1_500));
    bridge.signal(Signal::INT);
    let (_, log) = bridge.wait();
    (reader.join().unwrap(), log)
}

#[test]
fn malformed_blocks_are_an_error_of_the_packed_code_and_do_not_count_as_decoded() {
    let mut recording = PackedRecording::new(Board::new(), Streams::PACKED);
    for index in 0..24 {
        if index == 10 {
            recording.hop_of(&[0x5a; 200]);
        } else {
            recording.hop();
        }
    }
    let (messages, log) = messages(recording);
    // The log speaks of what streams.
    assert!(
        log.contains("packed blocks: 16 per second") && !log.contains("codes: 16 per second"),
        "{log}"
    );
    // A replay refuses every rate; the model's is no warning.
    let refused = log.lines().find(|line| line.contains("refuses the rate 4"));
    let refused = refused.unwrap();
    assert!(refused.contains("INFO"), "{log}");
    assert_has(&log, ["windows: decoded 23 ", "packed blocks malformed 1"]);
    let reports = messages.iter().filter(|(topic, _)| topic == "/diagnostics");
    let statuses = reports.filter_map(|(_, report)| {
        let mut statuses = report["status"].as_array()?.iter();
        statuses.find(|status| status["name"] == "corticode: packed code")
    });
    let statuses: Vec<&Value> = statuses.collect();
    let errors: Vec<_> = statuses
        .iter()
        .filter(|status| status["level"] == "error")
        .collect();
    assert_eq!(errors.len(), 1, "{statuses:?}");
    let message = errors[0]["message"].as_str().unwrap();
    assert!(
        message.starts_with("1 blocks are no blocks of the model"),
        "{message}"
    );
    let values = statuses.last().unwrap()["values"].as_array().unwrap();
    let malformed = values.iter().find(|value| value["key"] == "malformed");
    assert_eq!(malformed.unwrap()["value"], "1");
    let frames = messages
        .iter()
        .filter(|(topic, _)| topic == "/neurodata_reconstructed");
    let flags = frames.map(|(_, frame)| frame["tri"]["data"][0].as_u64().unwrap());
    let flags: Vec<u64> = flags.collect();
    assert_eq!(flags.len(), 24, "{log}");
    assert_eq!(flags.iter().position(|flags| *flags >= 0x8000), Some(10));
}
