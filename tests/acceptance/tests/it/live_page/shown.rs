//! A board whose cable loses frames, and the bridge that serves the page and prints JSON.

use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::printing::{self, board_with, bridge};
use acceptance::process::{Process, SLACK};
use rustix::process::Signal;

pub(super) const TOKEN: &str = "a-token-of-the-test";
/// Interval between edges of the trigger input, in microseconds. The first edge rises one interval
/// after boot, which is device time 0.
pub(super) const EDGE_US: u64 = 700_000;

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
        let options = ["--seed=7", "--realtime", "--duration=600", "--trigger-every=0.7"];
        let board = board_with(folder.path(), &output, &options);
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

    /// Starts a bridge with `token`, or with a random token if it is `None`.
    pub(super) fn start_bridge(&mut self, token: Option<&str>, streams: &str) {
        let streams = format!("--streams={streams}");
        let address = format!("--view-address=127.0.0.1:{}", self.port);
        let arguments =
            ["--port", &self.cable.port, "--sink=view,ndjson", &streams, "--exclude=Cz", &address];
        let token = token.map(|token| ["--view-token", token]);
        let arguments = [&arguments[..], token.as_slice().as_flattened()].concat();
        self.bridge = Some(bridge(self.folder.path(), "bridge", &arguments));
    }

    pub(super) fn stop_bridge(&mut self) -> String {
        let bridge = self.bridge.take().expect("a bridge");
        let (log, lines) = (bridge.errors(), self.lines());
        assert!(bridge.stop(Signal::TERM, SLACK).success(), "{log}");
        lines
    }

    pub(super) fn lines(&self) -> String {
        self.bridge.as_ref().map(Process::output).unwrap_or_default()
    }

    pub(super) fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Returns the newest value of `key` in the status `outlets`.
    pub(super) fn figure(&self, key: &str) -> Option<u64> {
        let status = printing::statuses(&self.lines(), "outlets").last()?;
        printing::figure(&status, key)?.parse().ok()
    }
}
