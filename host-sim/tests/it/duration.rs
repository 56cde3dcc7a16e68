//! `--duration` ends a run, whether a host has connected or not.

use std::{
    io::Read as _,
    time::{Duration, Instant},
};

use link::{Streams, ToDevice};

use crate::program::{connect, free_address, program, run, send, start, wait};

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
        assert!(finished.log.contains("no host started the stream"), "{finished:?}");
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
        send(&mut port, 0, start(streams));
        port.read_to_end(&mut Vec::new()).expect("all frames");
        // The program ends only after its host has closed the connection.
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
        let commands = [Some(start(Streams::ALL)), command];
        for (number, command) in (0..).zip(commands.into_iter().flatten()) {
            send(&mut port, number, command);
            // Read a part of the response, which shows that the board has executed the command.
            port.read_exact(&mut [0; 100]).expect("frames");
        }
        drop(port);
        assert_eq!(wait(child).status, Some(0), "{pace}");
    }
}
