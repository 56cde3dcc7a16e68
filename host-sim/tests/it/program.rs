//! Runs the program `host-sim` for the tests, reads its output, and connects to the board's port as
//! a host.

use std::{
    ffi::OsStr,
    io::Write,
    net::{TcpListener, TcpStream},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use link::{Decoder, Encoder, Frame, MAX_FRAME, Start, Streams, ToDevice, ToHost};

/// Time limit of each wait: far longer than any operation takes, even on a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_mins(1);

/// Returns an address on which no program listens.
pub(crate) fn free_address() -> String {
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    free.local_addr().expect("its address").to_string()
}

/// Repeats `attempt` until it returns a value; fails after [`TIMEOUT`].
pub(crate) fn eventually<T>(mut attempt: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + TIMEOUT;
    loop {
        if let Some(value) = attempt() {
            return value;
        }
        assert!(Instant::now() < deadline, "no success within {TIMEOUT:?}");
        thread::sleep(Duration::from_millis(10));
    }
}

/// Connects to the board at `address`, which may not listen yet.
pub(crate) fn connect(address: &str) -> TcpStream {
    eventually(|| TcpStream::connect(address).ok())
}

pub(crate) const fn start(streams: Streams) -> ToDevice<'static> {
    ToDevice::Start(Start { streams, mains_hz: 0 })
}

/// Sends a command in a frame whose sequence number is `number`.
pub(crate) fn send(port: &mut impl Write, number: u32, command: ToDevice<'_>) {
    let mut buffer = [0; MAX_FRAME];
    let frame = Encoder::starting_at(number).encode(0, &command, &mut buffer);
    let sent = port.write_all(frame.expect("a command fits"));
    sent.expect("the board's port is open");
}

/// Decodes `bytes`, which must be whole frames, and returns what `select` picks from the frames.
pub(crate) fn frames<T>(
    mut bytes: &[u8],
    mut select: impl FnMut(Frame<ToHost<'_>>) -> Option<T>,
) -> Vec<T> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut seen = Vec::new();
    while let Some(frame) = decoder.next::<ToHost<'_>>(&mut bytes) {
        seen.extend(select(frame.expect("a whole frame")));
    }
    seen
}

/// Result of a run that has ended.
#[derive(Debug)]
pub(crate) struct Finished {
    /// Exit status; `None` if a Unix signal killed the program.
    pub(crate) status: Option<i32>,
    /// Text that the run wrote to standard error.
    pub(crate) log: String,
}

/// Returns a command that runs the program with these arguments.
pub(crate) fn program<A: AsRef<OsStr>>(arguments: &[A]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Runs the program with these arguments and waits until it ends.
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
        thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().expect("a child");
    Finished {
        status: output.status.code(),
        log: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}
