//! Tests of `--sink ndjson`, with which the bridge writes lines of JSON instead of using ROS.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use link::Streams;
use rustix::process::Signal;
use serde_json::Value;

use crate::board::{Board, assert_has};
use crate::device::{Device, PACE};
use crate::packed_recording::PackedRecording;
use crate::process::Bridge;

#[test]
fn frames_are_written_as_lines_until_the_bridge_is_interrupted() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::start(&["--port", &device.port, "--sink", "ndjson"]);
    let mut lines = BufReader::new(bridge.stdout()).lines();
    let mut seen = std::collections::HashMap::new();
    let mut last_seq = 0;
    let mut take = |line: std::io::Result<String>| {
        let line: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let topic = line["topic"].as_str().unwrap().to_owned();
        if topic == "/encoded" {
            last_seq = line["message"]["neuroheader"]["seq"].as_u64().unwrap();
        }
        *seen.entry(topic).or_insert(0_u32) += 1;
    };
    lines.by_ref().take(60).for_each(&mut take);
    bridge.signal(Signal::INT);
    lines.for_each(take);
    let made = device.controls.made.load(Relaxed);
    assert_eq!(last_seq, u64::from(made), "codes are missing at the end");
    let log = bridge.success();
    assert_has(&log, [&format!("made {made} received {made} lost 0")]);
    assert!(
        seen["/encoded"] > 20 && seen["/neurodata_reconstructed"] > 15,
        "{seen:?}"
    );
}

#[test]
fn a_reader_that_closes_the_pipe_ends_the_bridge_without_an_error() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::start(&["--port", &device.port, "--sink", "ndjson"]);
    let mut lines = BufReader::new(bridge.stdout()).lines();
    lines.next().unwrap().unwrap();
    drop(lines);
    bridge.success();
}

#[test]
fn codes_of_another_model_are_published_and_the_log_has_advice() {
    let device = Device::tcp(Board {
        model_id: [9; 8],
        ..Board::new()
    });
    let mut bridge = Bridge::start(&["--port", &device.port, "--sink", "ndjson"]);
    let lines = BufReader::new(bridge.stdout()).lines();
    let topics: Vec<String> = lines
        .take(30)
        .map(|line| serde_json::from_str::<Value>(&line.unwrap()).unwrap()["topic"].to_string())
        .collect();
    assert!(topics.iter().any(|topic| topic.contains("encoded")));
    assert!(!topics.iter().any(|topic| topic.contains("reconstructed")));
    let (_, log) = bridge.wait();
    assert_has(&log, ["0909090909090909", "--model"]);
}

#[test]
fn a_reader_that_does_not_read_cannot_prevent_the_shutdown() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::start(&["--port", &device.port, "--sink", "ndjson"]);
    let stdout = bridge.stdout();
    // The lines of 100 codes exceed the 64 KB that a pipe holds.
    while device.controls.made.load(Relaxed) < 100 {
        std::thread::sleep(PACE);
    }
    bridge.signal(Signal::TERM);
    let (status, log) = bridge.wait();
    assert_eq!(status.code(), Some(1), "{log}");
    assert!(log.contains("lines are lost"), "{log}");
    drop(stdout);
}

#[test]
fn all_streams_are_written_as_lines_and_a_wrong_code_is_an_error() {
    let device = Device::tcp(Board::new());
    let streams = "codes,raw,filtered,audit,events";
    let mut bridge = Bridge::start(&[
        "--port",
        &device.port,
        "--sink",
        "ndjson",
        "--streams",
        streams,
    ]);
    let lines = BufReader::new(bridge.stdout()).lines();
    let mut counts = std::collections::HashMap::new();
    let mut next_raw = 1;
    let mut verdict = None;
    for line in lines {
        let line: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let topic = line["topic"].as_str().unwrap().to_owned();
        let message = &line["message"];
        match &*topic {
            "/neurodata" => {
                assert_eq!(message["neuroheader"]["seq"], next_raw);
                next_raw += 1;
                assert_eq!(message["eeg"]["data"].as_array().unwrap().len(), 32 * 61);
                assert_eq!(message["exg"]["data"].as_array().unwrap().len(), 32 * 3);
            }
            "/events/bus" => assert_eq!(message["event"], 1),
            "/diagnostics" => {
                let statuses = message["status"].as_array().unwrap();
                let audit = statuses.iter().find(|s| s["name"] == "corticode: audit");
                verdict = audit.map(|audit| audit["level"].as_str().unwrap().to_owned());
            }
            _ => {}
        }
        *counts.entry(topic).or_insert(0_u32) += 1;
        if verdict.is_some() && counts["/encoded"] > 60 {
            break;
        }
    }
    bridge.signal(Signal::TERM);
    assert_eq!(verdict.unwrap(), "error");
    let (encoded, raw) = (counts["/encoded"], counts["/neurodata"]);
    assert!(raw.abs_diff(encoded) <= 8, "{counts:?}");
    assert!(
        counts["/neurodata_corticode"].abs_diff(encoded) <= 8,
        "{counts:?}"
    );
    assert!(counts["/events/bus"] >= 4, "{counts:?}");
}

const PAGE: &str = include_str!("../../../../docs/json-lines.md");

/// Returns the fields that a section of the page lists.
fn listed(section: &str) -> BTreeSet<String> {
    let title = format!("\n## {section}\n");
    let (_, text) = PAGE.split_once(&title).unwrap();
    let text = text.split("\n## ").next().unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| row.split('`').next().unwrap().to_owned())
        .collect()
}

/// Adds the fields of a value below `path`. A list of objects has the fields of its elements.
fn collect(value: &Value, path: &str, fields: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (name, value) in object {
                let path = if path.is_empty() {
                    name.clone()
                } else {
                    format!("{path}.{name}")
                };
                collect(value, &path, fields);
            }
        }
        Value::Array(values) if values.iter().any(Value::is_object) => {
            for value in values {
                collect(value, &format!("{path}[]"), fields);
            }
        }
        _ => {
            fields.insert(path.to_owned());
        }
    }
}

#[test]
fn the_lines_have_exactly_the_fields_of_the_page() {
    let device = Device::tcp(Board::new());
    let streams = "--streams=codes,raw,filtered,audit,events";
    let mut bridge = Bridge::start(&["--port", &device.port, "--sink", "ndjson", streams]);
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in BufReader::new(bridge.stdout()).lines() {
        let line: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let names: BTreeSet<String> = line.as_object().unwrap().keys().cloned().collect();
        assert_eq!(names, listed("Every line"));
        let topic = line["topic"].as_str().unwrap().to_owned();
        collect(&line["message"], "", found.entry(topic).or_default());
        if found.len() == 6 && found["/diagnostics"].len() > 4 {
            break;
        }
    }
    bridge.signal(Signal::TERM);
    assert_eq!(found.remove("/events/bus").unwrap(), listed("Events"));
    assert_eq!(found.remove("/diagnostics").unwrap(), listed("Reports"));
    assert_eq!(found.len(), 4, "{:?}", found.keys());
    let frames = listed("Frames");
    for (topic, fields) in found {
        for block in ["eeg.", "exg.", "tri."] {
            let others = ["eeg.", "exg.", "tri."].map(|other| (other, other != block));
            let of_block = fields.iter().filter(|field| {
                let is_other =
                    |(other, differs): &(&str, bool)| *differs && field.starts_with(other);
                !others.iter().any(is_other)
            });
            let of_block = of_block.map(|field| field.replacen(block, "eeg.", 1));
            assert_eq!(
                of_block.collect::<BTreeSet<_>>(),
                frames,
                "{topic}, {block}"
            );
        }
    }
}

/// Replays a recording to a bridge, and returns the bridge's messages with their topics, and its
/// log.
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
