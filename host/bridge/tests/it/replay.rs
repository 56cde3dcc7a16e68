//! The subcommand `replay`: a bridge that connects to a replay publishes the recorded codes.

use std::io::Cursor;
use std::time::Duration;

use capture::{Pace, Replayer};
use link::{Decoder, Encoder, MAX_FRAME, Start, Streams, ToDevice, ToHost};
use rustix::process::Signal;
use serde_json::Value;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::process::{Bridge, free_address, wait_for_bytes};
use crate::record::read;
use crate::synthetic_recording::Rig;

/// Replays a recording to a bridge. Returns the bridge's messages, each with its topic, and the
/// logs of both programs as one text.
pub(crate) fn replayed(
    arguments: &[&str],
    port: &str,
    streams: &str,
) -> (Vec<(String, Value)>, String) {
    let replay = Bridge::start(&[&["replay"], arguments].concat());
    let arguments = ["--port", port, "--sink", "ndjson", "--streams", streams];
    let mut bridge = Bridge::start(&arguments);
    let messages = bridge.messages();
    let reader = std::thread::spawn(move || messages.collect());
    let log = replay.success();
    // Long enough for the last report to /diagnostics.
    std::thread::sleep(Duration::from_millis(1_500));
    bridge.signal(Signal::INT);
    let (_, bridge_log) = bridge.wait();
    (reader.join().unwrap(), log + &bridge_log)
}

/// Replays a recording to a bridge. Returns the published codes without fillers, and the logs of
/// both programs as one text.
fn replayed_codes(arguments: &[&str], port: &str, streams: &str) -> (Vec<Vec<f64>>, String) {
    let (mut messages, log) = replayed(arguments, port, streams);
    messages.retain(|(topic, message)| {
        topic == "/encoded" && message["tri"]["data"][0].as_u64().unwrap() < 32_768
    });
    let codes = messages.iter().map(|(_, message)| {
        let values = message["eeg"]["data"].as_array().unwrap().iter();
        values.map(|value| value.as_f64().unwrap()).collect()
    });
    (codes.collect(), log)
}

#[test]
fn a_bridge_at_a_terminal_gets_every_recorded_code_in_real_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    let file = path.to_str().unwrap();
    let device = Device::tcp(Board::new());
    let recorder = Bridge::start(&["record", file, "--port", &device.port]);
    wait_for_bytes(&path, 20_000);
    recorder.end(Signal::TERM);
    let port = folder.path().join("board");
    let output = format!("pty:{}", port.display());
    let recorded = read(&path).codes;
    let arguments = [file, "--output", &output];
    let (codes, log) = replayed_codes(&arguments, port.to_str().unwrap(), "codes,audit,events");
    assert_eq!(codes, recorded, "{log}");
    assert!(recorded.len() > 50 && log.contains("lost 0 ("), "{log}");
    assert!(!port.exists(), "the link is removed at the end");
}

#[test]
fn a_restart_and_losses_of_the_recording_reach_the_bridge() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    let mut rig = Rig::new(5);
    rig.run(60, 7);
    rig.restart(1_700_000);
    rig.run(60, 7);
    std::fs::write(&path, rig.finish()).unwrap();
    let recorded = read(&path).codes;
    assert!(recorded.len() < 120, "no code was lost");
    let port = format!("tcp:{}", free_address());
    let arguments = [path.to_str().unwrap(), "--fast", "--output", &port];
    for streams in ["codes,raw,filtered,events", "codes"] {
        let (codes, log) = replayed_codes(&arguments, &port, streams);
        assert_eq!(codes, recorded, "{log}");
        assert!(log.contains("resets 1"), "{log}");
    }
}

#[test]
fn what_cannot_be_replayed_is_status_2_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    std::fs::write(&path, Rig::new(0).finish()).unwrap();
    let file = path.to_str().unwrap();
    let taken = format!("pty:{file}");
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(&path, &link).unwrap();
    let linked = format!("pty:{}", link.display());
    for (file, output, expected) in [
        ("/etc/hostname", &*taken, "is not a recording"),
        (file, &*taken, "cannot be made a port"),
        (file, &*linked, "cannot be made a port"),
        (file, "tcp:192.0.2.1:5", "with a free port"),
    ] {
        let log = Bridge::start(&["replay", file, "--output", output]).failure(2);
        assert_has(&log, [expected]);
    }
}

#[test]
fn a_host_that_asks_for_no_codes_gets_none() {
    let mut rig = Rig::new(0);
    rig.run(20, 7);
    let mut replayer = Replayer::new(Cursor::new(rig.finish()), Pace::Fast).unwrap();
    let start = ToDevice::Start(Start { streams: Streams::FILTERED, mains_hz: 0 });
    let mut buffer = [0; MAX_FRAME];
    let bytes = Encoder::starting_at(0).encode(0, &start, &mut buffer);
    replayer.receive(bytes.unwrap()).unwrap();
    let mut bytes = Vec::new();
    while !replayer.is_finished() {
        replayer.play(1_000).unwrap();
        bytes.extend(replayer.take());
    }
    let (mut bytes, mut decoder) = (&bytes[..], Decoder::<MAX_FRAME>::new());
    let (mut codes, mut filtered) = (0, 0);
    while let Some(Ok(frame)) = decoder.next::<ToHost>(&mut bytes) {
        codes += u32::from(matches!(frame.message, ToHost::Code(_)));
        filtered += u32::from(matches!(frame.message, ToHost::Filtered(_)));
    }
    assert_eq!((codes, filtered), (0, 40));
}
