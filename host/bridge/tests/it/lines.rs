//! Tests of `--sink ndjson`, with which the bridge prints lines of JSON and uses no ROS.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{BufRead, BufReader};
use std::sync::atomic::Ordering::Relaxed;

use link::Streams;
use rustix::process::Signal;
use serde_json::Value;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::packed_recording::PackedRecording;
use crate::process::{Bridge, figure, free_address, wait_until};
use crate::replay::replayed;

#[test]
fn frames_are_written_as_lines_until_the_bridge_is_interrupted() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::ndjson(&device.port);
    let mut messages = bridge.messages();
    let mut seen = HashMap::new();
    let mut last_seq = 0;
    let mut take = |(topic, message): (String, Value)| {
        if topic == "/encoded" {
            last_seq = message["neuroheader"]["seq"].as_u64().unwrap();
        }
        *seen.entry(topic).or_insert(0_u32) += 1;
    };
    messages.by_ref().take(60).for_each(&mut take);
    bridge.signal(Signal::INT);
    messages.for_each(take);
    let made = device.controls.made.load(Relaxed);
    assert_eq!(last_seq, u64::from(made), "codes are missing at the end");
    let log = bridge.success();
    assert_has(&log, [&format!("made {made} received {made} lost 0")]);
    assert!(seen["/encoded"] > 20 && seen["/neurodata_reconstructed"] > 15, "{seen:?}");
}

#[test]
fn a_reader_that_closes_the_pipe_ends_the_bridge_without_an_error() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::ndjson(&device.port);
    bridge.messages().next().unwrap();
    bridge.success();
}

#[test]
fn codes_of_another_model_are_published_and_the_log_has_advice() {
    let device = Device::tcp(Board::of_another_model());
    let mut bridge = Bridge::ndjson(&device.port);
    let messages = bridge.messages().take(30);
    let topics: BTreeSet<String> = messages.map(|(topic, _)| topic).collect();
    assert!(topics.contains("/encoded"), "{topics:?}");
    assert!(!topics.contains("/neurodata_reconstructed"), "{topics:?}");
    let (_, log) = bridge.wait();
    assert_has(&log, ["0909090909090909", "--model"]);
}

#[test]
fn a_reader_that_does_not_read_cannot_prevent_the_shutdown() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::ndjson(&device.port);
    let stdout = bridge.stdout();
    // The lines of 100 codes exceed the 64 KB that a pipe holds.
    wait_until("codes", || device.controls.made.load(Relaxed) >= 100);
    bridge.signal(Signal::TERM);
    let (status, log) = bridge.wait();
    assert_eq!(status.code(), Some(1), "{log}");
    assert!(log.contains("lines are lost"), "{log}");
    drop(stdout);
}

const PAGE: &str = include_str!("../../../../docs/json-lines.md");

/// Returns the names of the fields that a section of docs/json-lines.md lists.
fn listed(section: &str) -> BTreeSet<String> {
    let title = format!("\n## {section}\n");
    let (_, text) = PAGE.split_once(&title).unwrap();
    let text = text.split("\n## ").next().unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| row.split('`').next().unwrap().to_owned()).collect()
}

/// Adds the paths of all fields in the JSON value at `path`, and of the fields of objects in lists.
fn collect(value: &Value, path: &str, fields: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (name, value) in object {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
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
fn all_streams_have_exactly_the_fields_of_the_page_and_a_wrong_code_is_an_error() {
    let device = Device::tcp(Board::new());
    let streams = "--streams=codes,raw,filtered,audit,events";
    let mut bridge = Bridge::start(&["--port", &device.port, "--sink", "ndjson", streams]);
    let (mut counts, mut next_raw, mut verdict) = (HashMap::new(), 1, None);
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in BufReader::new(bridge.stdout()).lines() {
        let line: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let names: BTreeSet<String> = line.as_object().unwrap().keys().cloned().collect();
        assert_eq!(names, listed("Every line"));
        let (topic, message) = (line["topic"].as_str().unwrap(), &line["message"]);
        collect(message, "", found.entry(topic.to_owned()).or_default());
        match topic {
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
        *counts.entry(topic.to_owned()).or_insert(0_u32) += 1;
        if verdict.is_some() && counts["/encoded"] > 60 && found.len() == 6 {
            break;
        }
    }
    bridge.signal(Signal::TERM);
    assert_eq!(verdict.unwrap(), "error");
    for topic in ["/neurodata", "/neurodata_corticode"] {
        let difference = counts[topic].abs_diff(counts["/encoded"]);
        assert!(difference <= 8, "{counts:?}");
    }
    assert!(counts["/events/bus"] >= 4, "{counts:?}");
    assert_eq!(found.remove("/events/bus").unwrap(), listed("Events"));
    assert_eq!(found.remove("/diagnostics").unwrap(), listed("Reports"));
    assert_eq!(found.len(), 4, "{:?}", found.keys());
    let frames = listed("Frames");
    for (topic, fields) in found {
        for block in ["eeg.", "exg.", "tri."] {
            let mut others = ["eeg.", "exg.", "tri."].to_vec();
            others.retain(|other| *other != block);
            let is_other = |field: &&String| others.iter().any(|other| field.starts_with(other));
            let of_block = fields.iter().filter(|field| !is_other(field));
            let of_block = of_block.map(|field| field.replacen(block, "eeg.", 1));
            let of_block: BTreeSet<String> = of_block.collect();
            assert_eq!(of_block, frames, "{topic}, {block}");
        }
    }
}

/// Replays a recording to a bridge. Returns its messages, each with its topic, and the logs.
fn messages(recording: PackedRecording) -> (Vec<(String, Value)>, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    std::fs::write(&path, recording.finish()).unwrap();
    let port = format!("tcp:{}", free_address());
    let arguments = [path.to_str().unwrap(), "--output", &port];
    replayed(&arguments, &port, "packed")
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
    // The log names the stream that is received: packed blocks, not codes.
    assert_has(&log, ["packed blocks: 16 per second"]);
    assert!(!log.contains("codes: 16 per second"), "{log}");
    // A replay refuses to set any rate. Its refusal of the model's rate is not worth a warning.
    let refused = log.lines().find(|line| line.contains("refuses the rate 4"));
    assert!(refused.unwrap().contains("INFO"), "{log}");
    assert_has(&log, ["windows: decoded 23 ", "packed blocks malformed 1"]);
    let reports = messages.iter().filter(|(topic, _)| topic == "/diagnostics");
    let statuses = reports.clone().filter_map(|(_, report)| {
        let mut statuses = report["status"].as_array()?.iter();
        statuses.find(|status| status["name"] == "corticode: packed code")
    });
    let statuses: Vec<&Value> = statuses.collect();
    let errors = statuses.iter().filter(|status| status["level"] == "error");
    let errors: Vec<_> = errors.collect();
    assert_eq!(errors.len(), 1, "{statuses:?}");
    let message = errors[0]["message"].as_str().unwrap();
    assert_has(message, ["1 blocks are no blocks of the model"]);
    let mut malformed =
        reports.filter_map(|(_, report)| figure(report, "packed code", "malformed"));
    assert_eq!(malformed.next_back(), Some("1"));
    let mut frames = messages;
    frames.retain(|(topic, _)| topic == "/neurodata_reconstructed");
    let flags = frames.iter().map(|(_, frame)| &frame["tri"]["data"][0]);
    let flags: Vec<u64> = flags.map(|flags| flags.as_u64().unwrap()).collect();
    assert_eq!(flags.len(), 24, "{log}");
    assert_eq!(flags.iter().position(|flags| *flags >= 0x8000), Some(10));
}
