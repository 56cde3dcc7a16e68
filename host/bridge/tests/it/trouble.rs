//! What the bridge logs about a full disk, a port of another device, and a bad link.

use std::io::Write;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::Ordering::Relaxed;
use std::thread::sleep;
use std::time::Duration;

use rustix::process::Signal;

use crate::board::Board;
use crate::device::Device;
use crate::process::Bridge;

#[test]
fn a_full_disk_is_status_1_and_the_log_says_so() {
    let device = Device::tcp(Board::new());
    let full = std::fs::File::options()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let bridge = Bridge::start_into(full, &["--port", &device.port, "--sink", "ndjson"]);
    let (status, log) = bridge.wait();
    assert_eq!(status.code(), Some(1), "{log}");
    assert!(log.contains("the disk of the output is full"), "{log}");
}

/// Starts a server that sends text to each client, and closes the connection after `lines` lines.
fn stranger(lines: u32) -> String {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for client in listener.incoming() {
            let mut client = client.unwrap();
            for _ in 0..lines {
                if client.write_all(b"$GPGGA,not a frame*00\r\n\0").is_err() {
                    break;
                }
                sleep(Duration::from_millis(20));
            }
        }
    });
    port
}

/// Returns the log of a bridge that runs for `time` at `port`.
fn log_of(port: &str, time: Duration) -> String {
    let null = std::fs::File::options()
        .write(true)
        .open("/dev/null")
        .unwrap();
    let bridge = Bridge::start_into(null, &["--port", port, "--sink", "ndjson"]);
    sleep(time);
    bridge.end(Signal::TERM)
}

#[test]
fn a_port_that_sends_something_else_is_logged_once() {
    // A silence is logged after 5 s. A port that closes is reopened every 250 ms.
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
