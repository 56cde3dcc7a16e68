//! `--duration` ends a run, whether a host has connected or not.

use std::{
    io::{Read as _, Write as _},
    net::{TcpListener, TcpStream},
    thread,
    time::{Duration, Instant},
};

use link::{Encoder, MAX_FRAME, Start, Streams, ToDevice};

use crate::program::{program, run, wait};

fn free_address() -> String {
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    free.local_addr().expect("its address").to_string()
}

#[test]
fn a_run_without_a_host_ends_after_its_duration() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let terminal = format!("--output=pty:{}", folder.path().join("board").display());
    let tcp = format!("--output=tcp:{}", free_address());
    for arguments in [&[&terminal[..]][..], &[&tcp], &[&tcp, "--fast"]] {
        let common = ["run", "--input=synthetic", "--duration=0.5"];
        let start = Instant::now();
        let finished = run(&[&common, arguments].concat());
        assert_eq!(finished.status, Some(0), "{finished:?}");
        assert!(start.elapsed() >= Duration::from_millis(500));
        assert!(
            finished.log.contains("no host started the stream"),
            "{finished:?}"
        );
    }
}

/// Connects to the program at `address`, which may not listen yet.
fn connect(address: &str) -> TcpStream {
    let deadline = Instant::now() + Duration::from_mins(1);
    loop {
        match TcpStream::connect(address) {
            Ok(port) => return port,
            Err(error) => assert!(Instant::now() < deadline, "{error}"),
        }
        thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn the_last_line_counts_what_the_host_asked_for() {
    let both = Streams::CODES | Streams::PACKED;
    for (streams, expected) in [
        (Streams::CODES, ": 15 codes made, 0 frames"),
        (Streams::PACKED, ": 16 packed blocks made, 0 frames"),
        (both, ": 15 codes made, 16 packed blocks made, 0 frames"),
    ] {
        let address = free_address();
        let tcp = format!("--output=tcp:{address}");
        let child = program(&["run", "--input=synthetic", "--duration=1", &tcp, "--fast"]);
        let child = { child }.spawn().expect("the program starts");
        let mut port = connect(&address);
        let start = ToDevice::Start(Start {
            streams,
            mains_hz: 0,
        });
        let mut buffer = [0; MAX_FRAME];
        let frame = Encoder::default().encode(0, &start, &mut buffer);
        port.write_all(frame.expect("it fits")).expect("connected");
        port.read_to_end(&mut Vec::new()).expect("all frames");
        // The program waits for it.
        drop(port);
        let finished = wait(child);
        assert!(finished.log.contains(expected), "{finished:?}");
    }
}

#[test]
fn a_run_whose_host_has_left_ends_too() {
    for (pace, command) in [("--realtime", Some(ToDevice::Stop)), ("--fast", None)] {
        let address = free_address();
        let tcp = format!("--output=tcp:{address}");
        let child = program(&["run", "-q", "--input=synthetic", "--duration=5", &tcp, pace]);
        let child = { child }.spawn().expect("the program starts");
        let mut port = connect(&address);
        let start = ToDevice::Start(Start {
            streams: Streams::ALL,
            mains_hz: 0,
        });
        for (number, command) in (0..).zip([Some(start), command].into_iter().flatten()) {
            let mut buffer = [0; MAX_FRAME];
            let frame = Encoder::default().encode(number, &command, &mut buffer);
            port.write_all(frame.expect("it fits")).expect("connected");
            // Some bytes of the answer.
            port.read_exact(&mut [0; 100]).expect("frames");
        }
        drop(port);
        assert_eq!(wait(child).status, Some(0), "{pace}");
    }
}
