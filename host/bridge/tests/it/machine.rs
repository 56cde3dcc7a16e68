//! The bridge on a simulated machine, whose boards are plugged in and out.

use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use link::SelfTest;
use rustix::process::Signal;
use serde_json::Value;
use tempfile::TempDir;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::process::{Bridge, wait_until};
use crate::simulated_machine::{BOARD, Descriptor, OTHER, SimulatedMachine};

/// Shell script for a mount namespace of its own: mounts `dev` and `sys` of the folder `$1` over
/// the machine's, and runs the rest of its arguments. `/dev/pts` stays the machine's.
const SCRIPT: &str = r#"
mkdir -p "$1/dev/pts" && touch "$1/dev/null" \
    && mount --bind /dev/null "$1/dev/null" && mount --rbind /dev/pts "$1/dev/pts" \
    && mount --rbind "$1/dev" /dev && mount --rbind "$1/sys" /sys \
    && shift && exec "$@"
"#;

/// Returns whether this user can create namespaces, which `test` needs. If not, prints that the
/// test is skipped, or panics if CORTICODE_REQUIRE_ROS is 1.
fn namespaces(test: &str) -> bool {
    let status = namespace().arg("true").stderr(Stdio::null()).status();
    if status.is_ok_and(|status| status.success()) {
        return true;
    }
    let required = std::env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(!required, "{test} needs `unshare --user --mount`, and CORTICODE_REQUIRE_ROS is 1");
    // Written to stderr directly, because the test harness captures `eprintln!`.
    let line = format!("SKIPPED: {test}: this user may not run `unshare --user --mount`\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
    false
}

fn namespace() -> Command {
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount"]);
    command
}

/// Starts the bridge with these arguments on the simulated machine.
fn bridge_on(machine: &SimulatedMachine, arguments: &[&str]) -> Bridge {
    let mut command = namespace();
    command
        .args(["sh", "-c", SCRIPT, "sh"])
        .arg(machine.folder())
        .arg(env!("CARGO_BIN_EXE_corticode-bridge"))
        .args(arguments)
        // Ignore the configuration file of the user who runs the tests.
        .env("CORTICODE_CONFIG", "/dev/null")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0);
    Bridge::spawn_command(&mut command)
}

/// Waits for the pseudoterminal to which `link` leads, and plugs it in as the port of `board`.
fn plug(machine: &SimulatedMachine, socket: u32, tty: &str, board: Descriptor<'_>, link: &Path) {
    let mut node = None;
    wait_until("the pseudoterminal", || {
        node = std::fs::read_link(link).ok();
        node.is_some()
    });
    machine.plug(socket, tty, board, node.as_deref());
}

/// Returns a machine with `board` at its port `tty`. The returned path is a link, in the returned
/// folder, to the board's pseudoterminal.
fn machine_with(board: Board, tty: &str) -> (SimulatedMachine, TempDir, PathBuf, Device) {
    let machine = SimulatedMachine::new();
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("board");
    let device = Device::pty(board, &link);
    plug(&machine, 2, tty, BOARD, &link);
    (machine, folder, link, device)
}

#[test]
fn auto_finds_the_board_again_at_another_port() {
    if !namespaces("--port auto") {
        return;
    }
    let (machine, _folder, link, device) = machine_with(Board::new(), "ttyACM0");
    let mut bridge = bridge_on(&machine, &["--sink", "ndjson"]);
    let mut codes = bridge.messages().filter(|(topic, _)| topic == "/encoded");
    assert!(codes.by_ref().take(5).count() == 5);
    device.controls.unplugged.store(true, Relaxed);
    machine.unplug(2, "ttyACM0");
    device.controls.hang_up.store(true, Relaxed);
    wait_until("the end of the port", || !device.controls.hang_up.load(Relaxed));
    machine.plug(3, "ttyACM0", OTHER, None);
    let made = device.controls.made.load(Relaxed);
    device.controls.unplugged.store(false, Relaxed);
    plug(&machine, 2, "ttyACM1", BOARD, &link);
    let window = |code: &Value| code["tri"]["data"][1].as_u64().unwrap();
    assert!(codes.any(|(_, code)| window(&code) > u64::from(made)));
    bridge.signal(Signal::TERM);
    codes.for_each(drop);
    let log = bridge.success();
    for tty in ["ttyACM0", "ttyACM1"] {
        let opened = format!("/dev/{tty} (board {}) is open", BOARD.serial);
        assert_eq!(log.matches(&opened).count(), 1, "{log}");
    }
}

#[test]
fn a_board_that_is_silent_is_named_with_its_port() {
    if !namespaces("--port auto with a silent board") {
        return;
    }
    let (machine, _folder, _, device) = machine_with(Board::new(), "ttyACM0");
    device.controls.stand_still.store(true, Relaxed);
    let mut bridge = bridge_on(&machine, &["--port", "auto", "--sink", "ndjson"]);
    let stdout = bridge.stdout();
    let reader = std::thread::spawn(move || std::io::read_to_string(stdout));
    // Long enough for the bridge to log the silence, which it does after 5 s.
    std::thread::sleep(Duration::from_secs(12));
    let log = bridge.end(Signal::TERM);
    let board = format!("/dev/ttyACM0 (board {})", BOARD.serial);
    assert_has(&log, [&format!("speaks Corticode: {board} sent")]);
    reader.join().unwrap().unwrap();
}

#[test]
fn selftest_reset_and_record_find_the_board_by_its_serial_number() {
    if !namespaces("--port auto:SERIAL") {
        return;
    }
    let board =
        Board { restarts_on_reset: true, self_test: Some(SelfTest::default()), ..Board::new() };
    let (machine, folder, _, device) = machine_with(board, "ttyACM3");
    machine.plug(3, "ttyACM0", OTHER, None);
    // The device prints its serial number in lower case, USB reports it in upper case.
    let auto = format!("auto:{}", BOARD.serial.to_lowercase());
    for task in ["selftest", "reset"] {
        let (_, text, log) = bridge_on(&machine, &[task, "--port", &auto]).output();
        assert!(text.contains("firmware test"), "{task}: {text} {log}");
    }
    let file = folder.path().join("session.wire");
    let file = file.to_str().unwrap();
    let record = bridge_on(&machine, &["record", file, "--port", &auto]);
    wait_until("codes", || device.controls.made.load(Relaxed) >= 5);
    let log = record.end(Signal::TERM);
    assert!(log.contains("/dev/ttyACM3 (board "), "{log}");
}

#[test]
fn ports_and_selftest_see_the_boards_of_the_machine() {
    if !namespaces("ports") {
        return;
    }
    let machine = SimulatedMachine::new();
    let run = |arguments: &[&str]| bridge_on(&machine, arguments).output();
    let (code, _, log) = run(&["selftest", "--port", "auto"]);
    assert_eq!(code, Some(3), "{log}");
    let remedy = "corticode-bridge ports lists";
    assert_has(&log, ["no Corticode board is on USB", remedy]);
    machine.plug(2, "ttyACM0", BOARD, None);
    machine.plug_ftdi(4, "ttyUSB0");
    let (code, text, log) = run(&["ports"]);
    assert_eq!(code, Some(0), "{log}");
    println!("{text}");
    let link = format!("/dev/corticode-{}", BOARD.serial);
    assert_has(&text, [&link, "FT232R USB UART"]);
    let (code, text, log) = run(&["ports", "--json"]);
    assert_eq!(code, Some(0), "{log}");
    let ports: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(ports[0]["path"], "/dev/ttyACM0");
    assert_eq!(ports[0]["board"], "board");
    assert_eq!(ports[1]["driver"], "ftdi_sio");
    machine.plug(3, "ttyACM1", OTHER, None);
    for arguments in [&["selftest", "--port", "auto"][..], &["--port", "auto", "--sink", "ndjson"]]
    {
        let (code, _, log) = run(arguments);
        assert_eq!(code, Some(2), "{log}");
        let listed = format!("{} (/dev/ttyACM0), 3B (/dev/ttyACM1)", BOARD.serial);
        assert_has(&log, [&listed, "--port auto:SERIAL"]);
    }
}
