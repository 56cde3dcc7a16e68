//! A board whose cable loses frames, and the bridge that serves the page and prints JSON.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::printing::{bridge, messages};
use acceptance::process::Process;
use acceptance::programs::programs;
use rustix::process::Signal;

pub(super) const TOKEN: &str = "a-token-of-the-test";
pub(super) const TIMEOUT: Duration = Duration::from_mins(1);
/// Interval between edges of the trigger input, microseconds; the first one is an interval after
/// boot, which is device time 0, and rises.
pub(super) const EDGE_US: u64 = 700_000;

/// Starts ten minutes of a board in real time.
fn board(folder: &Path, output: &str) -> Process {
    let mut board = Command::new(&programs().host_sim);
    board
        .args(["run", "--input=synthetic", "--seed=7", "--realtime"])
        .args(["--duration=600", "--trigger-every=0.7"])
        .arg(format!("--output={output}"));
    Process::start("board", &mut board, folder).expect("host-sim starts")
}

/// A board whose cable loses frames, and the bridge that serves the page and prints JSON.
pub(super) struct Shown {
    pub(super) folder: tempfile::TempDir,
    _board: Process,
    cable: LossyCable,
    bridge: Option<Process>,
    port: u16,
}

impl Shown {
    pub(super) fn start() -> Shown {
        let folder = tempfile::tempdir().expect("a folder");
        let port = free_port().expect("a free port");
        let output = format!("tcp:127.0.0.1:{port}");
        let board = board(folder.path(), &output);
        let mut shown = Shown {
            cable: LossyCable::new(port, 1).expect("a cable"),
            folder,
            _board: board,
            bridge: None,
            port: free_port().expect("a free port"),
        };
        shown.start_bridge(Some(TOKEN), "codes,raw,filtered,events,audit");
        shown
    }

    /// Starts a bridge with a token, or with a random one.
    pub(super) fn start_bridge(&mut self, token: Option<&str>, streams: &str) {
        let streams = format!("--streams={streams}");
        let address = format!("--view-address=127.0.0.1:{}", self.port);
        let arguments = [
            "--port",
            &self.cable.port,
            "--sink=view,ndjson",
            &streams,
            "--exclude=Cz",
            &address,
        ];
        let token = token.map(|token| ["--view-token", token]);
        let arguments = [&arguments[..], token.as_slice().as_flattened()].concat();
        self.bridge = Some(bridge(self.folder.path(), "bridge", &arguments));
    }

    pub(super) fn stop_bridge(&mut self) -> String {
        let bridge = self.bridge.take().expect("a bridge");
        let (log, lines) = (bridge.errors(), self.lines());
        assert!(bridge.stop(Signal::TERM, TIMEOUT).success(), "{log}");
        lines
    }

    pub(super) fn lines(&self) -> String {
        self.bridge
            .as_ref()
            .map(Process::output)
            .unwrap_or_default()
    }

    pub(super) fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Returns the newest value of `key` in the status `outlets`.
    pub(super) fn figure(&self, key: &str) -> Option<u64> {
        let report = messages(&self.lines(), "/diagnostics").last()?;
        let status = report["status"].as_array()?.iter();
        let mut values =
            status.flat_map(|status| status["values"].as_array().into_iter().flatten());
        let value = values.find(|value| value["key"] == key)?;
        value["value"].as_str()?.parse().ok()
    }

    pub(super) fn wait_for(&self, what: &str, holds: impl Fn(&Shown) -> bool) {
        let end = Instant::now() + TIMEOUT;
        while !holds(self) {
            assert!(Instant::now() < end, "{what}: not within {TIMEOUT:?}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}
