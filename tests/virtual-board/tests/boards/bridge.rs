//! The bridge that users run, at the board's port.

use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use std::{env, thread};

use virtual_board::{TcpPort, VirtualBoard, live};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_sound, power_on};

/// Real time that the bridge may take: the board may run at a fraction of real time on a busy machine.
const PATIENCE: Duration = Duration::from_secs(180);

/// Codes that the bridge is to publish before it is ended.
const CODES: usize = 48;

/// Runs the bridge at the board's port until it ends or `enough` says so of its output.
fn bridge(
    board: &mut VirtualBoard,
    arguments: &[&str],
    enough: fn(&str) -> bool,
) -> (String, Option<i32>) {
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
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let result = read(&mut child, enough);
            stop.store(true, Relaxed);
            result
        });
        let run = live::run(board, &mut tcp, None, &stop, std::io::sink());
        run.unwrap_or_else(|trouble| panic!("{trouble}"));
        reader.join().expect("the reader ends")
    })
}

fn read(child: &mut Child, enough: fn(&str) -> bool) -> (String, Option<i32>) {
    let begin = Instant::now();
    let mut output = child.stdout.take().expect("it is piped");
    let mut text = Vec::new();
    let mut chunk = [0; 4096];
    while begin.elapsed() < PATIENCE {
        match output.read(&mut chunk) {
            Ok(0) | Err(_) => break,
            Ok(length) => text.extend_from_slice(&chunk[..length]),
        }
        if enough(&String::from_utf8_lossy(&text)) {
            let _ = child.kill();
            break;
        }
    }
    if begin.elapsed() >= PATIENCE {
        let _ = child.kill();
    }
    let status = child.wait().ok().and_then(|status| status.code());
    (String::from_utf8_lossy(&text).into_owned(), status)
}

/// Lines about codes.
fn codes(text: &str) -> usize {
    text.lines()
        .filter(|line| line.contains("\"topic\":\"/encoded\""))
        .count()
}

/// The bridge's self-test finds everything in order, and its stream has every code.
pub(crate) fn connects(subject: Subject) {
    let mut board = power_on(subject, &subject.setup());
    let (table, status) = bridge(&mut board, &["selftest"], |_| false);
    assert_eq!(status, Some(0), "{table}");
    assert!(
        table.contains("all in order: 8 chips, 64 channels"),
        "{table}"
    );
    record(subject, "bridge_selftest", true);

    let (text, _) = bridge(&mut board, &["--sink", "ndjson"], |text| {
        codes(text) >= CODES
    });
    assert!(codes(&text) >= CODES, "{text}");
    assert_sound(&mut board);
    record(subject, "bridge_codes", codes(&text));
}
