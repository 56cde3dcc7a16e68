//! What the bridge logs about a full disk, the port of another device, and a bad link.

use std::io::Write;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::sleep;
use std::time::Duration;

use rustix::process::Signal;
use serde_json::Value;

use crate::board::Board;
use crate::device::Device;
use crate::process::{Bridge, serve};

fn open(path: &str) -> std::fs::File {
    std::fs::File::options().write(true).open(path).unwrap()
}

#[test]
fn a_full_disk_is_status_1_and_the_log_says_so() {
    let device = Device::tcp(Board::new());
    let full = open("/dev/full");
    let bridge = Bridge::start_into(full, &["--port", &device.port, "--sink", "ndjson"]);
    let log = bridge.failure(1);
    assert!(log.contains("the disk of the output is full"), "{log}");
}

#[test]
fn lines_on_a_disk_that_becomes_full_end_with_a_whole_line() {
    let device = Device::tcp(Board::new());
    let file = tempfile::NamedTempFile::new().unwrap();
    let arguments = ["--port", &device.port, "--sink", "ndjson"];
    let stdout = file.reopen().unwrap().into();
    Bridge::start_on_full_disk(&arguments, stdout).failure(1);
    let text = std::fs::read_to_string(file.path()).unwrap();
    assert!(text.len() > 8_000 && text.ends_with('\n'), "{text}");
    for line in text.lines() {
        serde_json::from_str::<Value>(line).unwrap();
    }
}

/// Starts a TCP server that is no board: it sends each client `lines` lines of text, and then
/// closes the connection. Returns its port.
pub(crate) fn stranger(lines: u32) -> String {
    serve(move |mut client| {
        for _ in 0..lines {
            if client.write_all(b"$GPGGA,not a frame*00\r\n\0").is_err() {
                break;
            }
            sleep(Duration::from_millis(20));
        }
    })
}

/// Runs a bridge on `port` for `time`, and returns its log.
fn log_of(port: &str, time: Duration) -> String {
    let null = open("/dev/null");
    let bridge = Bridge::start_into(null, &["--port", port, "--sink", "ndjson"]);
    sleep(time);
    bridge.end(Signal::TERM)
}

#[test]
fn a_port_that_sends_something_else_is_logged_once() {
    // Long enough for the bridge to log a silence (after 5 s), and to reopen many times a port that
    // always closes (every 250 ms).
    for (lines, time) in [(u32::MAX, 12), (5, 3)] {
        let log = log_of(&stranger(lines), Duration::from_secs(time));
        let said = log.matches("nothing here speaks Corticode").count();
        assert_eq!(said, 1, "{log}");
        assert!(log.contains("check that --port names"), "{log}");
        assert!(log.lines().count() <= 5, "{log}");
    }
}

#[test]
fn damaged_frames_and_lost_codes_are_one_line_a_minute() {
    let device = Device::tcp(Board::new());
    device.controls.damage.store(true, Relaxed);
    let log = log_of(&device.port, Duration::from_secs(4));
    assert_eq!(log.matches("bad link").count(), 1, "{log}");
    let warnings = log.matches("frames damaged").count() + log.matches("codes missing").count();
    assert_eq!(warnings, 1, "{log}");
}
