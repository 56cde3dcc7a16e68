//! Starts the programs of Debian's ROS 1 if they are installed.

use std::{
    os::unix::process::CommandExt as _,
    path::PathBuf,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use ros1::xmlrpc::call_ros;

use crate::local::{TIMEOUT, free_port, report_skipped, uri};

const INSTALL: &str = "apt-get install -y --no-install-recommends ros-core python3-std-srvs";

/// Returns whether ROS is installed. If not, reports on stderr that the test is skipped, or fails
/// if CORTICODE_REQUIRE_ROS is 1.
pub(crate) fn installed(test: &str) -> bool {
    if PathBuf::from("/usr/bin/roscore").exists() {
        return true;
    }
    let required = std::env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(!required, "{test} needs ROS 1 and CORTICODE_REQUIRE_ROS is 1; run: {INSTALL}");
    report_skipped(test, &format!("roscore is not installed; run: {INSTALL}"));
    false
}

/// Prepares a command for a ROS program that uses the master on `port`. `PATH` selects Debian's
/// Python.
pub(crate) fn command(program: &str, port: u16) -> Command {
    let home = concat!(env!("CARGO_TARGET_TMPDIR"), "/ros");
    let mut command = Command::new(format!("/usr/bin/{program}"));
    command
        .env("PATH", "/usr/bin:/bin:/usr/sbin:/sbin")
        .env("ROS_MASTER_URI", uri(port))
        .env("ROS_HOSTNAME", "127.0.0.1")
        .env("ROS_HOME", home)
        .env("ROS_LOG_DIR", home)
        .env("PYTHONUNBUFFERED", "1")
        .stdin(Stdio::null());
    command
}

/// A child process in a separate process group; dropping it kills the group.
pub(crate) struct Running {
    pub(crate) child: Child,
}

impl Running {
    pub(crate) fn start(mut command: Command) -> Self {
        Self { child: command.process_group(0).spawn().unwrap() }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        kill("-KILL", &format!("-{}", self.child.id()));
        let _ = self.child.wait();
    }
}

fn kill(signal: &str, process: &str) {
    let _ = Command::new("/bin/kill").args([signal, "--", process]).stderr(Stdio::null()).status();
}

/// A running `rosmaster`, or a `roscore` with the master and the rosout node that it starts.
pub(crate) struct RosMaster {
    pub(crate) port: u16,
    /// Process ID of the master itself, which roscore starts in another process group.
    pid: i32,
    running: Running,
}

impl Drop for RosMaster {
    /// Kills the master, then interrupts roscore, which stops its other child processes.
    fn drop(&mut self) {
        kill("-KILL", &self.pid.to_string());
        kill("-INT", &self.running.child.id().to_string());
        let interrupted = Instant::now();
        while matches!(self.running.child.try_wait(), Ok(None)) {
            if interrupted.elapsed() > Duration::from_secs(20) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl RosMaster {
    /// Starts `rosmaster` or `roscore` on a free port and waits until the master answers.
    pub(crate) async fn start(program: &str) -> Self {
        let port = free_port();
        let mut command = command(program, port);
        if program == "rosmaster" {
            command.arg("--core");
        }
        command.args(["-p", &port.to_string()]).stdout(Stdio::null()).stderr(Stdio::null());
        let running = Running::start(command);
        let started = Instant::now();
        let pid = loop {
            if let Ok(pid) = call_ros(&uri(port), "getPid", &["/test".into()]).await {
                break pid.as_int().unwrap();
            }
            assert!(started.elapsed() < TIMEOUT, "{program} does not answer");
            tokio::time::sleep(Duration::from_millis(50)).await;
        };
        Self { port, pid, running }
    }

    pub(crate) fn uri(&self) -> String {
        uri(self.port)
    }
}
