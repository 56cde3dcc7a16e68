//! Starts and stops child processes, each with a log file for its output.

use std::env;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use tokio::process::{Child, Command};
use tokio::time::timeout;

use crate::Failure;

/// Name of the program that simulates the board.
pub(crate) const BOARD: &str = "host-sim";
/// Name of the bridge's program.
pub(crate) const BRIDGE: &str = "corticode-bridge";
/// Name of the program that trains models and classifiers.
pub(crate) const TRAINER: &str = "trainer";

/// A running child process; killed when dropped.
pub(crate) struct Program {
    name: String,
    pub(crate) child: Child,
    log: PathBuf,
}

impl Program {
    /// Starts the program at `path`. Its stderr goes to a file in `logs`, and so does its stdout
    /// unless `stdout` is another destination.
    pub(crate) fn start(
        path: &Path,
        arguments: &[&str],
        logs: &Path,
        stdout: Option<Stdio>,
    ) -> Result<Self, Failure> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let log = logs.join(&*name).with_extension("log");
        let start = || -> io::Result<Child> {
            let file = File::create(&log)?;
            let mut command = Command::new(path);
            // `CORTICODE_` variables configure the user's own runs of these programs, not this one.
            for (name, _) in env::vars_os() {
                if name.to_string_lossy().starts_with("CORTICODE_") {
                    command.env_remove(name);
                }
            }
            command
                .args(arguments)
                .stdin(Stdio::null())
                .stdout(match stdout {
                    Some(stdout) => stdout,
                    None => file.try_clone()?.into(),
                })
                .stderr(file)
                // The child gets its own process group, so that Ctrl-C in the terminal reaches only
                // this program, which stops its children.
                .process_group(0)
                .kill_on_drop(true)
                .spawn()
        };
        let child = start().map_err(|error| {
            Failure::unreachable(&name, error, "`cargo demo` or `cargo loop`, which build it")
        })?;
        let name = name.into_owned();
        Ok(Self { name, child, log })
    }

    /// Returns everything that the program has printed so far.
    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }

    /// Returns the failure for a program that ended too early, with everything that it has printed.
    pub(crate) fn ended(&self) -> Failure {
        let why = format!("it ended early and printed:\n{}", self.log());
        Failure::unreachable(&self.name, why, "see its message")
    }

    /// Returns the failure for a program that did not do its part within the time `after`. `what`
    /// states what did not happen, such as "no code came".
    pub(crate) fn timed_out(&self, what: &str, after: Duration) -> Failure {
        let (name, log) = (&self.name, self.log());
        let why = format!("{what} within {} s; {name} printed:\n{log}", after.as_secs_f64());
        let next = "is the machine very busy? run it again";
        Failure::unreachable("the path", why, next)
    }

    /// Sends SIGTERM to the program. Fails unless it ends with status 0 within `deadline`.
    pub(crate) async fn terminate(&mut self, deadline: Duration) -> Result<(), Failure> {
        let pid = self.child.id().map(u32::cast_signed);
        if let Some(pid) = pid.and_then(Pid::from_raw) {
            // Sending fails if the program has already ended; the `wait` below then returns its
            // status.
            let _ = kill_process(pid, Signal::TERM);
        }
        match timeout(deadline, self.child.wait()).await {
            Ok(Ok(status)) if status.success() => Ok(()),
            _ => Err(self.timed_out("it did not end cleanly on SIGTERM", deadline)),
        }
    }
}
