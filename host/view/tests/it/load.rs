//! Slow viewers and many connections, which delay nobody.

use std::io::{Read as _, Write as _};
use std::time::{Duration, Instant};

use neuro_ros::{DiagnosticArray, NeuroDataInfo, NeuroFrame, Sink, Wire};
use view::ViewTopic;

use crate::client::{Served, read_message, status, wait_until};

/// Number of frames that are published: more than a socket's buffers and the ring hold together.
const FRAMES: u32 = 4000;

fn frame() -> NeuroFrame {
    let labels = (0..61).map(|index| format!("E{index}")).collect();
    let eeg = NeuroDataInfo { nsamples: 32, ..NeuroDataInfo::default() };
    NeuroFrame::zeros(512, "", eeg.with_labels(labels), NeuroDataInfo::default())
}

#[test]
fn a_viewer_that_stands_still_costs_no_other_a_frame_and_the_publisher_no_time() {
    let served = Served::start("127.0.0.1:0");
    let mut sink = served.view.sink(ViewTopic::Raw);
    let still = served.view();
    let mut fast = served.view();
    wait_until("two viewers", || served.view.viewers() == 2);
    let mut frame = frame();
    let mut longest = Duration::ZERO;
    for seq in 0..FRAMES {
        frame.neuroheader.seq = seq;
        let before = Instant::now();
        sink.publish(&frame).unwrap();
        longest = longest.max(before.elapsed());
        let message = read_message(&mut fast);
        assert_eq!(message[0], 4);
        assert_eq!(NeuroFrame::from_bytes(&message[9..]), Ok(frame.clone()));
    }
    println!("longest publication: {longest:?}");
    // The viewer that reads nothing is disconnected, and the messages that it missed are counted.
    wait_until("the end of the slow viewer", || served.view.viewers() == 1);
    assert!(served.view.dropped() > 100, "{}", served.view.dropped());
    drop(still);
}

#[test]
fn idle_connections_lock_no_viewer_out() {
    let served = Served::start("127.0.0.1:0");
    let mut first = served.view();
    let idle: Vec<_> = (0..200).map(|_| served.connect()).collect();
    let begun = Instant::now();
    drop(served.view());
    assert_eq!(status(&served.request("GET /", "")), "200");
    // Idle connections would time out by themselves only after 5 s.
    assert!(begun.elapsed() < Duration::from_secs(4));
    let mut sink = served.view.sink(ViewTopic::Diagnostics);
    sink.publish(&DiagnosticArray::default()).unwrap();
    assert_eq!(read_message(&mut first)[0], ViewTopic::Diagnostics as u8);
    for mut stream in idle {
        assert_eq!(stream.read(&mut [0]).unwrap_or(0), 0);
    }
}

#[test]
fn a_ninth_viewer_is_refused_until_another_leaves() {
    let served = Served::start("127.0.0.1:0");
    let mut viewers: Vec<_> = (0..8).map(|_| served.view()).collect();
    assert_eq!(status(&served.request("GET /stream", "")), "503");
    viewers.pop();
    let mut sink = served.view.sink(ViewTopic::Diagnostics);
    wait_until("room for a viewer", || {
        sink.publish(&DiagnosticArray::default()).unwrap();
        let mut stream = served.connect();
        let request = format!("GET /stream HTTP/1.1\r\nHost: {}\r\n\r\n", served.address);
        stream.write_all(request.as_bytes()).unwrap();
        let mut head = [0; 12];
        stream.read_exact(&mut head).is_ok() && head == *b"HTTP/1.1 200"
    });
}
