//! A recording of `/neurodata` in ROS-Neuro's format has every event at its sample, and every
//! status word as it was published. This holds after a restart of the device, a suspension of the
//! bridge or an unplugged cable, and while frames are lost. A recorder of the Lab Streaming Layer
//! in the same sessions has the same samples, at the times at which the board made them.
//! `CORTICODE_RECORDER_SECONDS` sets the duration of each run, 12 s by default.
//!
//! These tests are an executable of their own, because they judge times by the wall clock, and no
//! test that loads the machine may run at the same time. They run beside one another, because each
//! mostly waits.
#![forbid(unsafe_code)]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "indices of seconds of samples, and 16-bit words, in floating point"
)]

mod recorded;
mod streamed;

use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::process::Process;
use acceptance::programs::programs;
use acceptance::ros::{Ros, TIMEOUT};
use acceptance::{lsl_recording, wheels, workspace};
use emulator::skip::skip_unless_required;
use recordings::Recording;
use rustix::process::Signal;

use crate::recorded::Recorded;
use crate::streamed::Streamed;

/// Sampling rate of the recording, Hz.
const RATE: f64 = 512.0;
/// Number of samples in a frame of `/neurodata`.
const FRAME: usize = 32;
/// Largest permitted error of an event's time in the recording, seconds. On a busy machine, the
/// first frame reaches the recorder late by up to this time, which shifts all events.
const TOLERANCE_S: f64 = 0.03;
/// Time limit for a program to exit after SIGTERM.
const EXIT_TIMEOUT: Duration = Duration::from_mins(1);
/// Event code that marks a rising edge of the trigger input in the GDF file.
const TRIGGER_HIGH: u16 = 1;

/// A running board, a bridge, a ROS master, and recorders of the bridge's raw samples and events.
struct Session<'a> {
    folder: &'a Path,
    _ros: Ros<'a>,
    board: Process,
    bridge: Process,
    recorder: Process,
    /// Recorder of the bridge's raw samples and events through the Lab Streaming Layer; `None`
    /// without pylsl.
    lsl_recorder: Option<Process>,
    /// By how much the clock of each board so far is fast, parts per million.
    ppm: Vec<i32>,
}

impl<'a> Session<'a> {
    /// Starts a board whose clock is fast by `ppm` parts per million, and all other programs.
    fn start(folder: &'a Path, ppm: i32) -> Self {
        let port = folder.join("port").display().to_string();
        let board = board(folder, &format!("pty:{port}"), 0, ppm);
        Self::with_board(folder, board, &port, ppm)
    }

    /// Starts the bridge, which reaches `board` at the address `port`, and the recorders.
    fn with_board(folder: &'a Path, board: Process, port: &str, ppm: i32) -> Self {
        let ros = Ros::start_master_of(&programs().bridge, folder).expect("the master starts");
        let mut bridge = Command::new(&programs().bridge);
        bridge.args(["--streams=codes,raw,events", "--announce=raw", "--port", port]);
        let interpreter = wheels::python("a recording of the Lab Streaming Layer");
        // Name the streams after the folder, whose name is unique.
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        if let Some(interpreter) = &interpreter {
            bridge.args(["--sink=ros,lsl", "--lsl-name", &name, "--liblsl"]);
            bridge.arg(wheels::liblsl(interpreter));
        }
        bridge.args(["--ros-master-uri", &ros.master_uri()]);
        bridge.env("CORTICODE_CONFIG", "/dev/null").env("ROS_HOSTNAME", "127.0.0.1");
        let bridge = Process::start("bridge", &mut bridge, folder).expect("the bridge starts");
        let mut lsl_recorder = interpreter.map(|interpreter| {
            let arguments = [&*folder.to_string_lossy(), &name, "raw", "events"];
            lsl_recording::start(&interpreter, folder, "lsl_record", &arguments)
        });
        let script = workspace::root().join("tests/acceptance/ros/record_gdf.py");
        let script = script.canonicalize().expect("the script exists");
        let mut python = ros.command("python3");
        python.arg(script).arg("/neurodata").arg(folder.join("run.gdf"));
        let mut recorder = Process::start("recorder", &mut python, folder).expect("python3 starts");
        recorder.wait_until("the recorder records", TIMEOUT, |recorder| {
            recorder.output().contains("recording")
        });
        if let Some(recorder) = &mut lsl_recorder {
            recorder
                .wait_until("the streams", TIMEOUT, |recorder| recorder.output().contains("ready"));
        }
        Self { folder, _ros: ros, board, bridge, recorder, lsl_recorder, ppm: vec![ppm] }
    }

    /// Kills the board and starts a new one after the time `outage`.
    fn restart_board(&mut self, outage: Duration) {
        self.board.kill();
        sleep(outage);
        let port = self.folder.join("port");
        self.board = board(self.folder, &format!("pty:{}", port.display()), 1, 0);
        self.ppm.push(0);
    }

    /// Ends the recordings and compares them. Returns the recording of ROS-Neuro's recorder and the
    /// bridge's log.
    fn stop(mut self) -> (Recorded, String) {
        let log = self.bridge.errors();
        let exit = self.bridge.stop(Signal::TERM, EXIT_TIMEOUT);
        assert!(exit.success(), "the bridge: {exit}\n{log}");
        let errors = self.recorder.errors();
        let exit = self.recorder.stop(Signal::TERM, EXIT_TIMEOUT);
        assert!(exit.success(), "the recorder: {exit}\n{errors}");
        self.board.kill();
        let recording = Recording::open(self.folder.join("run.gdf")).expect("a GDF file");
        let recorded = Recorded::read(recording);
        if let Some(mut recorder) = self.lsl_recorder {
            let exit = recorder.wait(EXIT_TIMEOUT);
            assert!(exit.success(), "{}", recorder.log());
            let error_s = Streamed::read(self.folder).check(&recorded, &self.ppm);
            println!("largest error of a time of LSL {:.0} us", error_s * 1e6);
        }
        (recorded, log)
    }
}

/// Starts host-sim as the test's board number `number`; it sends to `output`, and its clock is fast
/// by `ppm` parts per million.
fn board(folder: &Path, output: &str, number: u32, ppm: i32) -> Process {
    let mut board = Command::new(&programs().host_sim);
    board.args(["run", "--input=synthetic", "--realtime", "--quiet", "--trigger-every=0.7"]);
    board.arg(format!("--output={output}"));
    board.arg(format!("--clock-ppm={ppm}"));
    Process::start(&format!("board{number}"), &mut board, folder).expect("host-sim starts")
}

/// Returns half the duration of a run.
fn half() -> Duration {
    let seconds = std::env::var("CORTICODE_RECORDER_SECONDS");
    let seconds = seconds.map_or(12, |seconds| seconds.parse().expect("a number of seconds"));
    Duration::from_secs(seconds) / 2
}

/// Returns whether Python, rospy and libxdffileio are installed; if not, reports a skipped test.
fn available() -> bool {
    let load = "import ctypes, genpy, rospy; ctypes.CDLL('libxdffileio.so.0')";
    let python = Command::new("/usr/bin/python3").args(["-c", load]).stderr(Stdio::null()).status();
    if python.is_ok_and(|status| status.success()) {
        return true;
    }
    skip_unless_required(
        "events in a recording of ROS-Neuro's format",
        "/usr/bin/python3 does not load rospy and libxdffileio; `apt-get install ros-core libxdffileio0`",
    );
    false
}

#[test]
fn events_are_at_their_samples_after_a_restart_of_the_board() {
    if !available() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = Session::start(folder.path(), 0);
    sleep(half());
    session.restart_board(Duration::from_secs(2));
    sleep(half());
    let (recorded, _) = session.stop();
    let error_s = recorded.largest_error_s();
    let fillers = recorded.fillers();
    println!("restart: largest error of an event {:.1} ms, {fillers} fillers", error_s * 1e3);
    assert!(error_s < TOLERANCE_S, "{error_s} s");
    assert!(fillers as f64 > 2.0 * RATE, "{fillers} fillers");
    assert!(recorded.reports.contains(&0x7ffe), "{:?}", recorded.reports);
}

#[test]
fn events_are_at_their_samples_whatever_the_clock_of_the_board() {
    if !available() {
        return;
    }
    let rates = [0, 300, -3_000, 10_000];
    let folders = rates.map(|_| tempfile::tempdir().expect("a folder"));
    let sessions = rates.iter().zip(&folders);
    let sessions: Vec<_> =
        sessions.map(|(ppm, folder)| (ppm, Session::start(folder.path(), *ppm))).collect();
    sleep(2 * half());
    for (ppm, session) in sessions {
        let (recorded, _) = session.stop();
        let error_s = recorded.largest_error_s();
        println!(
            "{ppm} ppm: largest error of an event {:.1} samples in {:.1} s",
            error_s * RATE,
            recorded.flags.len() as f64 / RATE
        );
        assert!(error_s < TOLERANCE_S, "{ppm} ppm: {error_s} s");
    }
}

#[test]
fn events_are_at_their_samples_after_the_bridge_stood_still() {
    if !available() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let session = Session::start(folder.path(), 0);
    sleep(half());
    session.bridge.signal(Signal::STOP);
    sleep(Duration::from_secs(13));
    session.bridge.signal(Signal::CONT);
    sleep(half());
    let (recorded, log) = session.stop();
    let error_s = recorded.largest_error_s();
    println!("stall: largest error of an event {:.1} ms; {log}", error_s * 1e3);
    assert!(error_s < TOLERANCE_S, "{error_s} s");
}

#[test]
fn events_are_at_their_samples_after_the_cable_was_unplugged() {
    let Some((recorded, error_s)) = with_cable("unplugged cable", 0, |cable| {
        sleep(half());
        cable.unplug();
        sleep(Duration::from_secs(2));
        cable.plug();
        sleep(half());
    }) else {
        return;
    };
    assert!(error_s < TOLERANCE_S, "{error_s} s");
    // The cable is unplugged for 2 s, and fillers replace the samples of this time. The bridge
    // tries to connect again every quarter of a second.
    assert!(recorded.fillers() as f64 > 1.9 * RATE, "{} fillers", recorded.fillers());
    assert!(recorded.reports.contains(&0x7f01), "{:?}", recorded.reports);
}

#[test]
fn events_are_at_their_samples_while_frames_are_lost() {
    let Some((recorded, error_s)) = with_cable("5 % loss", 5, |_| sleep(2 * half())) else {
        return;
    };
    assert!(error_s < TOLERANCE_S, "{error_s} s");
    let part = recorded.fillers() as f64 / recorded.flags.len() as f64;
    assert!((0.02..0.1).contains(&part), "{part} of the samples are lost");
    assert!(recorded.reports.contains(&0x7f01), "{:?}", recorded.reports);
}

/// Records through a cable that loses `percent` of the frames, while `scenario` runs. Returns the
/// recording and the largest error of an event's time in seconds; `None` if the test is skipped.
fn with_cable(
    test: &str,
    percent: u64,
    scenario: impl FnOnce(&LossyCable),
) -> Option<(Recorded, f64)> {
    if !available() {
        return None;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let port = free_port().expect("a free port");
    let board = board(folder.path(), &format!("tcp:127.0.0.1:{port}"), 0, 0);
    let cable = LossyCable::new(port, percent).expect("the board opens its port");
    let session = Session::with_board(folder.path(), board, &cable.port, 0);
    scenario(&cable);
    let (recorded, log) = session.stop();
    let error_s = recorded.largest_error_s();
    println!(
        "{test}: largest error of an event {:.1} ms in {:.1} s; {log}",
        error_s * 1e3,
        recorded.flags.len() as f64 / RATE
    );
    Some((recorded, error_s))
}
