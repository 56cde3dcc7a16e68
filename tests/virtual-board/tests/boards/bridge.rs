//! The bridge that users run, at the board's port.

use std::io::Read;
use std::process::{ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use std::{env, thread};

use virtual_board::{TcpPort, Trouble, VirtualBoard, live};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_sound, power_on};

/// Real time that the bridge may take: the board may run at a fraction of real time on a busy machine.
const PATIENCE: Duration = Duration::from_secs(180);

/// Times that a self-test is tried: the bridge waits 15 s of real time for one of 4.5 s of the board's.
const ATTEMPTS: usize = 3;

/// Codes that the bridge is to publish before it is ended.
const CODES: usize = 48;

/// Runs the bridge at the board's port until it ends, `enough` says so of its output, or it takes too long.
fn bridge(
    board: &mut VirtualBoard,
    arguments: &[&str],
    enough: fn(&str) -> bool,
) -> Result<(String, Option<i32>), Trouble> {
    let program = env::var_os("CORTICODE_BRIDGE").expect(
        "CORTICODE_BRIDGE names the bridge's program; `cargo xtask board` builds it and sets it",
    );
    let mut tcp = TcpPort::listen(0).expect("a free port");
    let port = format!("tcp:127.0.0.1:{}", tcp.number().expect("a number"));
    let mut child = Command::new(program)
        .args(arguments)
        .args(["--port", &port])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the bridge starts");
    let output = child.stdout.take().expect("it is piped");
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let text = read(output, enough);
            stop.store(true, Relaxed);
            text
        });
        let timer = scope.spawn(|| {
            let begin = Instant::now();
            while begin.elapsed() < PATIENCE && !stop.load(Relaxed) {
                thread::sleep(Duration::from_millis(50));
            }
            stop.store(true, Relaxed);
        });
        let run = live::run(board, &mut tcp, None, &stop, std::io::sink());
        stop.store(true, Relaxed);
        // Its output ends with it, and so does the reader. It may have ended by itself.
        thread::sleep(Duration::from_millis(200));
        let ended = child.try_wait().ok().flatten();
        let _ = child.kill();
        let status = ended.or_else(|| child.wait().ok());
        let text = reader.join().expect("the reader ends");
        timer.join().expect("the timer ends");
        run.map(|()| (text, status.and_then(|status| status.code())))
    })
}

fn read(mut output: ChildStdout, enough: fn(&str) -> bool) -> String {
    let mut text = Vec::new();
    let mut chunk = [0; 4096];
    while let Ok(length @ 1..) = output.read(&mut chunk) {
        text.extend_from_slice(&chunk[..length]);
        if enough(&String::from_utf8_lossy(&text)) {
            break;
        }
    }
    String::from_utf8_lossy(&text).into_owned()
}

/// Lines about codes.
fn codes(text: &str) -> usize {
    text.lines()
        .filter(|line| line.contains("\"topic\":\"/encoded\""))
        .count()
}

/// The bridge's self-test finds everything in order, and its stream has codes; `board_chain.rs` among the
/// acceptance tests looks for gaps.
pub(crate) fn connects(subject: Subject) -> Result<(), Trouble> {
    let mut board = power_on(subject, &subject.setup())?;
    let (mut table, mut status) = (String::new(), None);
    for _ in 0..ATTEMPTS {
        (table, status) = bridge(&mut board, &["selftest"], |_| false)?;
        if status == Some(0) {
            break;
        }
    }
    assert_eq!(status, Some(0), "{table}");
    assert!(
        table.contains("all in order: 8 chips, 64 channels"),
        "{table}"
    );
    record(subject, "bridge_selftest", true);

    let (text, _) = bridge(&mut board, &["--sink", "ndjson"], |text| {
        codes(text) >= CODES
    })?;
    assert!(codes(&text) >= CODES, "{text}");
    assert_sound(&mut board)?;
    record(subject, "bridge_codes", codes(&text));
    Ok(())
}
