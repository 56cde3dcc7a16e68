//! Scenarios with the program `corticode-bridge`, connected to a virtual board over TCP.

use std::io::Read;
use std::process::{ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;
use std::{env, thread};

use virtual_board::{BoardError, TcpPort, VirtualBoard, live};

use crate::commands::self_test_us;
use crate::images::Subject;
use crate::session::{assert_sound, power_on, running};

/// Longest time that one run of the bridge may take, in seconds of virtual time.
const TIMEOUT_S: u64 = 60;

/// Number of self-tests that the bridge may request. It waits 15 s of real time for each result,
/// and a self-test takes 4.5 s of virtual time, so on a slow machine the result can come too late.
const ATTEMPTS: usize = 3;

/// Number of codes that the bridge must publish.
const CODES: usize = 48;

/// Runs the bridge at the board's port until it exits, `is_enough` returns true for its output, or
/// [`TIMEOUT_S`] has passed. Returns the bridge's output and exit status.
fn bridge(
    board: &mut VirtualBoard,
    arguments: &[&str],
    is_enough: fn(&str) -> bool,
) -> Result<(String, Option<i32>), BoardError> {
    let program = env::var_os("CORTICODE_BRIDGE").expect(
        "CORTICODE_BRIDGE must contain the path of the bridge; `cargo xtask board` builds it and sets the variable",
    );
    let mut tcp = TcpPort::listen(0).expect("a free port");
    let port = format!("tcp:127.0.0.1:{}", tcp.number().expect("a number"));
    let mut child = Command::new(program)
        .args(arguments)
        .args(["--port", &port])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the bridge starts");
    let output = child.stdout.take().expect("a piped output");
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let text = read(output, is_enough);
            stop.store(true, Relaxed);
            text
        });
        let end_s = board.now_us() / 1_000_000 + TIMEOUT_S;
        let run = live::run(board, &mut tcp, Some(end_s), &stop, std::io::sink());
        // Give the bridge time to exit by itself before it is killed. The thread that reads the
        // bridge's output ends with the bridge.
        thread::sleep(Duration::from_millis(200));
        let ended = child.try_wait().ok().flatten();
        let _ = child.kill();
        let status = ended.or_else(|| child.wait().ok());
        let text = reader.join().expect("the reader ends");
        run.map(|()| (text, status.and_then(|status| status.code())))
    })
}

fn read(mut output: ChildStdout, is_enough: fn(&str) -> bool) -> String {
    let mut text = Vec::new();
    let mut chunk = [0; 4096];
    while let Ok(length @ 1..) = output.read(&mut chunk) {
        text.extend_from_slice(&chunk[..length]);
        if is_enough(&String::from_utf8_lossy(&text)) {
            break;
        }
    }
    String::from_utf8_lossy(&text).into_owned()
}

/// Returns the number of lines of the bridge's output that contain a code.
fn codes(text: &str) -> usize {
    text.lines().filter(|line| line.contains("\"topic\":\"/encoded\"")).count()
}

/// Scenario: `calibrate` refuses a board without memory for a packed model before it reads EEG.
pub(crate) fn bridge_cannot_calibrate(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let output = concat!(env!("CARGO_TARGET_TMPDIR"), "/never");
    let arguments = ["calibrate", "--subject=ada", "--output", output];
    // If the bridge read EEG, it would run for longer than [`TIMEOUT_S`] and have no exit status.
    let (_, status) = bridge(&mut board, &arguments, |_| false)?;
    assert_eq!(status, Some(4));
    assert_sound(&mut board)
}

/// Asserts that no code is missing in the bridge's output, and that the codes' device times are
/// 62.5 ms apart to within `period_us`, which is at least 1 because the board rounds device times
/// to whole microseconds.
fn assert_no_gap(text: &str, period_us: u64) {
    let complete = text.rfind('\n').map_or("", |end| &text[..end]);
    let codes = complete.lines().filter(|line| line.contains("\"topic\":\"/encoded\""));
    let mut first = None;
    for (index, line) in (0..).zip(codes) {
        // docs/topics.md lists the status words.
        let words = line.split("\"tri\":").nth(1).expect("status words");
        let words = words.split("\"data\":[").nth(1).expect("their values");
        let (words, _) = words.split_once(']').expect("their end");
        let words = words.split(',').map(|word| word.trim().parse().expect(words));
        let words: Vec<u64> = words.collect();
        let window = words[1] | words[2] << 16;
        let device_us = words[3] | words[4] << 16 | words[5] << 32;
        let (first_window, first_us) = *first.get_or_insert((window, device_us));
        assert_eq!((window, words[6]), (first_window + index, 0), "a gap");
        let error_us = (device_us - first_us).abs_diff(index * 62_500);
        assert!(error_us <= period_us, "code {index} is {error_us} us off");
    }
}

/// Scenario: the self-test that the bridge requests passes, and the bridge publishes codes, none of
/// which is missing.
pub(crate) fn bridge_delivers_codes(subject: Subject) -> Result<(), BoardError> {
    let mut board = power_on(subject, &subject.setup());
    let (mut table, mut status) = (String::new(), None);
    for _ in 0..ATTEMPTS {
        (table, status) = bridge(&mut board, &["selftest"], |_| false)?;
        if status == Some(0) {
            break;
        }
        // Wait until the self-test has ended; the device refuses another one before that.
        board.run_for_us(self_test_us(subject))?;
    }
    assert_eq!(status, Some(0), "{table}");
    let chips = subject.converters().chips;
    let verdict = format!("all in order: {chips} chips, {} channels", 8 * chips);
    assert!(table.contains(&verdict), "{table}");
    subject.record("bridge_selftest", true);

    let (text, _) = bridge(&mut board, &["--sink", "ndjson"], |text| codes(text) >= CODES)?;
    assert!(codes(&text) >= CODES, "{text}");
    // At 512 Hz, a hop is a whole number of samples; at other rates, codes are up to one sample
    // off.
    let rate_hz = subject.converters().rate_hz;
    let period_us = if rate_hz == 512 { 1 } else { 1_000_000 / u64::from(rate_hz) };
    assert_no_gap(&text, period_us);
    assert_sound(&mut board)?;
    subject.record("bridge_codes", codes(&text));
    Ok(())
}
