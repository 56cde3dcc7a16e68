//! Tests of `--sink ndjson`, with which the bridge writes lines of JSON instead of using ROS.

use std::io::{BufRead, BufReader};
use std::sync::atomic::Ordering::Relaxed;

use rustix::process::Signal;
use serde_json::Value;

use crate::board::{Board, assert_has};
use crate::device::{Device, PACE};
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
