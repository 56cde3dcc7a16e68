//! Codes that arrive faster than they are decoded, or late: the bridge loses none of them.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use link::Flags;
use rustix::process::Signal;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::process::{Bridge, wait_until};

/// Time limit for the bridge to decode all expected frames, long enough for a busy machine.
const PATIENCE: Duration = Duration::from_mins(3);

/// Reads the bridge's lines in a thread until `frames` frames of reconstructed signals have arrived
/// or the output ends. The thread returns the number of these frames, and of fillers among them.
fn reconstructed(bridge: &mut Bridge, frames: usize) -> JoinHandle<(usize, usize)> {
    let messages = bridge.messages();
    spawn(move || {
        let flags: Vec<u64> = messages
            .filter(|(topic, _)| topic == "/neurodata_reconstructed")
            .map(|(_, frame)| frame["tri"]["data"][0].as_u64().unwrap())
            .take(frames)
            .collect();
        let filler = u64::from(Flags::FILLER.bits());
        let fillers = flags.iter().filter(|flags| **flags & filler != 0).count();
        (flags.len(), fillers)
    })
}

/// Waits for a thread to end, for at most [`PATIENCE`], and then interrupts the bridge. Returns the
/// result of the thread.
fn join<T>(thread: JoinHandle<T>, bridge: &Bridge) -> T {
    let deadline = Instant::now() + PATIENCE;
    while !thread.is_finished() && Instant::now() < deadline {
        sleep(Duration::from_millis(20));
    }
    bridge.signal(Signal::INT);
    thread.join().unwrap()
}

/// Starts a board on a TCP port, which sends `codes` codes as fast as the host reads them and then
/// closes the connection. Returns the port.
fn fast_board(codes: u32) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    spawn(move || {
        // Serve one client only: a bridge that connects again would get all codes a second time.
        let (mut stream, _) = listener.accept().unwrap();
        let mut board = Board::new();
        let mut buffer = [0; 1024];
        while !board.streaming {
            let count = stream.read(&mut buffer).unwrap();
            let answers = board.answer(&buffer[..count]);
            stream.write_all(&answers).unwrap();
        }
        for code in 1..=u64::from(codes) {
            let bytes = board.code(code * 62_500, 3);
            stream.write_all(&bytes).unwrap();
        }
        // Read until the host closes: closing a socket that has unread bytes resets the connection.
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        while let Ok(count) = stream.read(&mut buffer)
            && count > 0
        {}
    });
    port
}

#[test]
fn a_board_faster_than_real_time_waits_for_the_decoder() {
    let codes = 1999;
    let port = fast_board(codes);
    let mut bridge = Bridge::ndjson(&port);
    let frames = reconstructed(&mut bridge, codes as usize);
    assert_eq!(join(frames, &bridge), (codes as usize, 0));
    let log = bridge.success();
    let decoded = "windows: decoded 1999 not decoded 0";
    assert_has(&log, ["made 1999 received 1999 lost 0", decoded]);
}

#[test]
fn a_tcp_board_that_stands_still_for_8_s_loses_no_code() {
    let device = Device::tcp(Board::new());
    let mut bridge = Bridge::ndjson(&device.port);
    // Frames of the 20 codes before the stall and of the 420 codes after it.
    let wanted = 440;
    let frames = reconstructed(&mut bridge, wanted);
    let made_at_least = |codes| {
        wait_until("codes", || device.controls.made.load(Relaxed) >= codes);
    };
    made_at_least(20);
    device.controls.stand_still.store(true, Relaxed);
    sleep(Duration::from_secs(8));
    let before = device.controls.made.load(Relaxed);
    device.controls.stand_still.store(false, Relaxed);
    made_at_least(before + 420);
    let (count, fillers) = join(frames, &bridge);
    assert_eq!((count, fillers), (wanted, 0));
    let made = device.controls.made.load(Relaxed);
    let log = bridge.success();
    assert!(log.contains("connections 1 resets 0"), "{log}");
    // The board may make up to two more codes before the bridge ends.
    let all =
        (made..made + 3).any(|made| log.contains(&format!("made {made} received {made} lost 0")));
    assert!(all, "not all of {made} codes or a few more were received: {log}");
}
