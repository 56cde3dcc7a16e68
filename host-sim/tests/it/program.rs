//! Runs of the program, and their output.

use std::{
    ffi::OsStr,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use crate::host::TIMEOUT;

/// A finished run.
#[derive(Debug)]
pub(crate) struct Finished {
    /// Exit status; `None` after a signal.
    pub(crate) status: Option<i32>,
    /// Standard error.
    pub(crate) log: String,
}

/// Returns the program with these arguments.
pub(crate) fn program<A: AsRef<OsStr>>(arguments: &[A]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

/// Runs the program to its end.
pub(crate) fn run<A: AsRef<OsStr>>(arguments: &[A]) -> Finished {
    wait(program(arguments).spawn().expect("the program starts"))
}

/// Waits for the end of a run; ends the program and fails after [`TIMEOUT`].
pub(crate) fn wait(mut child: Child) -> Finished {
    let deadline = Instant::now() + TIMEOUT;
    while child.try_wait().expect("a child").is_none() {
        if Instant::now() > deadline {
            child.kill().expect("a child");
            let log = child.wait_with_output().expect("a child").stderr;
            panic!("no end: {}", String::from_utf8_lossy(&log));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().expect("a child");
    Finished {
        status: output.status.code(),
        log: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}
