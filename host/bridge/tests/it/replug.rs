//! Ports that disappear and return while the bridge runs.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use rustix::fs::{Mode, OFlags};
use rustix::process::Signal;
use serde_json::Value;

use crate::board::Board;
use crate::device::Device;
use crate::process::{Bridge, TIMEOUT};

/// Returns a channel that yields each frame on `/encoded` with the time at which it arrived.
fn encoded(bridge: &mut Bridge) -> Receiver<(Instant, Value)> {
    let (frames, receiver) = channel();
    let messages = bridge.messages();
    std::thread::spawn(move || {
        for (topic, message) in messages {
            if topic == "/encoded" && frames.send((Instant::now(), message)).is_err() {
                return;
            }
        }
    });
    receiver
}

/// Unplugs and replugs the board `times` times. Returns for each replugging the time until the next
/// code arrived, and the bridge's log.
fn replug(device: &Device, mut bridge: Bridge, times: u32) -> (Vec<Duration>, String) {
    let frames = encoded(&mut bridge);
    let mut outages = Vec::new();
    for _ in 0..times {
        for _ in 0..5 {
            frames.recv_timeout(TIMEOUT).unwrap();
        }
        device.controls.unplugged.store(true, Relaxed);
        device.controls.hang_up.store(true, Relaxed);
        std::thread::sleep(Duration::from_millis(150));
        let plugged = Instant::now();
        device.controls.unplugged.store(false, Relaxed);
        while frames.recv_timeout(TIMEOUT).unwrap().0 < plugged {}
        outages.push(plugged.elapsed());
    }
    bridge.signal(Signal::TERM);
    let mut next = None;
    for (_, frame) in frames {
        let seq = frame["neuroheader"]["seq"].as_u64().unwrap();
        assert_eq!(next.unwrap_or(seq), seq);
        next = Some(seq + 1);
    }
    let log = bridge.success();
    (outages, log)
}

/// Returns the numbers that follow the words `made`, `received`, `lost`, `fillers` and
/// `connections` in the last line of the log.
fn totals(log: &str) -> [u32; 5] {
    let line = log.lines().last().unwrap();
    ["made", "received", "lost", "fillers", "connections"].map(|name| {
        let mut words = line.split_whitespace();
        words.find(|word| *word == name).unwrap();
        words.next().unwrap().parse().unwrap()
    })
}

#[test]
fn a_pseudoterminal_that_returns_under_another_name_is_reopened_and_so_is_a_broken_connection() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board");
    for (device, times) in [(Device::pty(Board::new(), &path), 8), (Device::tcp(Board::new()), 3)] {
        let (outages, log) = replug(&device, Bridge::ndjson(&device.port), times);
        println!("{log}\nback after {outages:?}");
        let [made, received, lost, fillers, connections] = totals(&log);
        assert_eq!(connections, times + 1, "{log}");
        assert_eq!(made, device.controls.made.load(Relaxed), "{log}");
        assert_eq!((received + lost, fillers), (made, lost), "{log}");
        assert!(lost > 0);
        // The bridge must reconnect within 1 s; a busy machine may take another second.
        let limit = Duration::from_secs(2);
        assert!(outages.iter().all(|outage| *outage < limit), "{outages:?}");
    }
}

#[test]
fn a_simulator_that_starts_again_at_its_port_is_a_restart_and_no_bad_link() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board");
    let device = Device::pty(Board::new(), &path);
    let mut bridge = Bridge::ndjson(&device.port);
    let frames = encoded(&mut bridge);
    frames.recv_timeout(TIMEOUT).unwrap();
    drop(device);
    std::fs::remove_file(&path).unwrap();
    std::thread::sleep(Duration::from_secs(1));
    let again = Board { session_id: 2, ..Board::new() };
    let _again = Device::pty(again, &path);
    let is_new_run = |frame: &Value| frame["tri"]["data"][1] == 0;
    while !is_new_run(&frames.recv_timeout(TIMEOUT).unwrap().1) {}
    // Wait for the next report to /diagnostics, which counts the missing codes.
    std::thread::sleep(Duration::from_millis(1500));
    let log = bridge.end(Signal::TERM);
    assert!(log.contains("the device was reset or replaced"), "{log}");
    assert!(log.contains("are missing between two runs of the device"), "{log}");
    assert!(!log.contains("bad link"), "{log}");
}

#[test]
fn with_exit_at_end_the_bridge_ends_when_the_port_closes_after_everything_is_published() {
    let device = Device::tcp(Board::new());
    let arguments = ["--port", &device.port, "--sink", "ndjson", "--exit-at-end"];
    let mut bridge = Bridge::start(&arguments);
    let frames = encoded(&mut bridge);
    for _ in 0..20 {
        frames.recv_timeout(TIMEOUT).unwrap();
    }
    let controls = std::sync::Arc::clone(&device.controls);
    drop(device);
    let log = bridge.success();
    let published = 20 + u32::try_from(frames.iter().count()).unwrap();
    assert_eq!(published, controls.made.load(Relaxed), "{log}");
    assert!(log.contains("shutting down: the port has closed"), "{log}");
}

#[test]
fn a_suspended_bridge_accounts_for_every_code() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::ndjson(&device.port);
    let frames = encoded(&mut bridge);
    frames.recv_timeout(TIMEOUT).unwrap();
    bridge.signal(Signal::STOP);
    std::thread::sleep(Duration::from_secs(2));
    bridge.signal(Signal::CONT);
    let made = device.controls.made.load(Relaxed);
    let caught_up = |frame: &Value| frame["tri"]["data"][1].as_u64().unwrap();
    while caught_up(&frames.recv_timeout(TIMEOUT).unwrap().1) < u64::from(made) {}
    let log = bridge.end(Signal::TERM);
    let [made, received, lost, fillers, _] = totals(&log);
    assert_eq!(made, device.controls.made.load(Relaxed), "{log}");
    assert_eq!((received + lost, fillers), (made, lost), "{log}");
}

#[test]
fn the_bridge_waits_for_an_absent_device() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board");
    let mut bridge = Bridge::ndjson(path.to_str().unwrap());
    let frames = encoded(&mut bridge);
    std::thread::sleep(Duration::from_millis(300));
    let _device = Device::pty(Board::new(), &path);
    frames.recv_timeout(TIMEOUT).unwrap();
    let log = bridge.end(Signal::TERM);
    assert!(log.contains("plug the device in"), "{log}");
}

#[test]
fn a_port_is_locked_by_one_bridge_and_released_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board");
    let device = Device::pty(Board::new(), &path);
    let mut first = Bridge::ndjson(&device.port);
    let of_first = encoded(&mut first);
    of_first.recv_timeout(TIMEOUT).unwrap();
    // Keep the pseudoterminal open all the time, as another program such as host-sim does.
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let held = rustix::fs::open(&path, flags, Mode::empty()).unwrap();
    let mut second = Bridge::ndjson(&device.port);
    let frames = encoded(&mut second);
    let while_taken = frames.recv_timeout(Duration::from_secs(1));
    assert!(while_taken.is_err(), "both bridges read the port");
    let log = Bridge::start(&["selftest", "--port", &device.port]).failure(3);
    assert!(log.contains("another program uses it: fuser -v"), "{log}");
    first.signal(Signal::KILL);
    drop(first);
    frames.recv_timeout(TIMEOUT).unwrap();
    let log = second.end(Signal::TERM);
    assert!(log.contains("fuser -v"), "{log}");
    drop(held);
}
