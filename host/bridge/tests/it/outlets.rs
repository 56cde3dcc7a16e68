//! Tests of `--sink` with several outlets at once.

use std::net::SocketAddr;
use std::sync::atomic::Ordering::Relaxed;

use neuro_ros::{DiagnosticArray, NeuroFrame, Wire};
use rustix::process::Signal;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::process::{Bridge, figure, free_address};
use crate::viewer::{next, view};

const TOKEN: &str = "0123456789abcdef";

/// Starts the bridge with `outlets`, among them the live page at `address`.
fn start(device: &Device, outlets: &str, address: SocketAddr) -> Bridge {
    let address = address.to_string();
    let streams = "--streams=codes,filtered,events";
    let arguments = ["--port", &device.port, "--sink", outlets, streams];
    let page = ["--view-address", &address, "--view-token", TOKEN];
    Bridge::start(&[&arguments[..], &page].concat())
}

#[test]
fn every_outlet_has_the_same_frames_and_is_named_in_diagnostics_and_the_last_line() {
    let device = Device::tcp(Board::new());
    let address = free_address();
    let mut bridge = start(&device, "view,ndjson", address);
    let messages = bridge.messages();
    let mut page = view(address);
    let on_page: Vec<NeuroFrame> =
        (0..10).map(|_| NeuroFrame::from_bytes(&next(&mut page, 1)).unwrap()).collect();
    let (mut compared, mut reported) = (0, false);
    for (topic, message) in messages {
        if topic == "/encoded"
            && let Some(frame) =
                on_page.iter().find(|frame| message["neuroheader"]["seq"] == frame.neuroheader.seq)
        {
            assert_eq!(serde_json::to_value(frame).unwrap(), message);
            compared += 1;
        }
        let dropped = |outlet| figure(&message, "outlets", &format!("{outlet} messages dropped"));
        if topic == "/diagnostics" && figure(&message, "outlets", "viewers") == Some("1") {
            assert_eq!(["ndjson", "view"].map(dropped), [Some("0"); 2]);
            reported = true;
        }
        if compared == on_page.len() && reported {
            break;
        }
    }
    // The end of the loop above has dropped `messages`, which closes the pipe. The page goes on,
    // and reports that the outlet `ndjson` has ended.
    let ended = "ndjson receives nothing any more";
    loop {
        let report = DiagnosticArray::from_bytes(&next(&mut page, 5)).unwrap();
        if report.status.iter().any(|status| status.message == ended) {
            break;
        }
    }
    let log = bridge.end(Signal::TERM);
    assert_has(
        &log,
        [
            "the outlet ndjson receives nothing any more",
            "; outlets: ndjson dropped 0 closed, view dropped 0",
        ],
    );
    assert!(!log.contains(TOKEN), "{log}");
}

#[test]
fn a_page_that_stands_still_costs_the_lines_no_code() {
    let device = Device::tcp(Board::new());
    let address = free_address();
    let mut bridge = start(&device, "view,ndjson", address);
    let messages = bridge.messages();
    let _still = view(address);
    let mut last = 0;
    let mut codes = 0;
    for (_, message) in messages.filter(|(topic, _)| topic == "/encoded") {
        let seq = message["neuroheader"]["seq"].as_u64().unwrap();
        assert!(last == 0 || seq == last + 1, "{last} to {seq}");
        last = seq;
        codes += 1;
        if codes == 200 {
            break;
        }
    }
    assert!(u64::from(device.controls.made.load(Relaxed)) < last + 50);
}

#[test]
fn an_address_in_use_or_a_short_token_is_refused_with_advice() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for (option, value, expected) in [
        ("--view-address", address.as_str(), "--view-address 127.0.0.1:8062"),
        ("--view-token", "short", "16 to 128 letters"),
    ] {
        let arguments = ["--port", "tcp:127.0.0.1:9", "--sink=view", option, value];
        let log = Bridge::start(&arguments).failure(2);
        assert!(log.contains(expected), "{log}");
    }
}
