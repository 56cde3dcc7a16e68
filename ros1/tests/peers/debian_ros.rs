//! The programs of Debian's ROS 1, when they are installed.

use std::{
    io::Write as _,
    net::TcpListener,
    os::unix::process::CommandExt as _,
    path::PathBuf,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use ros1::xmlrpc::call_ros;

const INSTALL: &str = "apt-get install -y --no-install-recommends ros-core python3-std-srvs";

/// True when ROS is installed. Otherwise says loudly that the test is skipped; with
/// CORTICODE_REQUIRE_ROS=1 that is a failure.
pub(crate) fn installed(test: &str) -> bool {
    if PathBuf::from("/usr/bin/roscore").exists() {
        return true;
    }
    let required = std::env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(
        !required,
        "{test} needs ROS 1 and CORTICODE_REQUIRE_ROS is 1; run: {INSTALL}"
    );
    // Not eprintln!: the test harness would swallow it.
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED: {test}: no roscore here; run: {INSTALL}"
    );
    false
}

/// A port that nobody listens on.
pub(crate) fn free_port() -> u16 {
    TcpListener::bind(("127.0.0.1", 0))
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

/// A program of ROS for the master at `port`, in Debian's own Python.
pub(crate) fn command(program: &str, port: u16) -> Command {
    let home = concat!(env!("CARGO_TARGET_TMPDIR"), "/ros");
    let mut command = Command::new(format!("/usr/bin/{program}"));
    command
        .env("PATH", "/usr/bin:/bin:/usr/sbin:/sbin")
        .env("ROS_MASTER_URI", format!("http://127.0.0.1:{port}/"))
        .env("ROS_HOSTNAME", "127.0.0.1")
        .env("ROS_HOME", home)
        .env("ROS_LOG_DIR", home)
        .env("PYTHONUNBUFFERED", "1")
        .stdin(Stdio::null());
    command
}

/// A program in a process group of its own, which is killed when this is dropped.
pub(crate) struct Running {
    pub(crate) child: Child,
}

impl Running {
    pub(crate) fn start(mut command: Command) -> Self {
        Self {
            child: command.process_group(0).spawn().unwrap(),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        kill("-KILL", &format!("-{}", self.child.id()));
        let _ = self.child.wait();
    }
}

fn kill(signal: &str, process: &str) {
    let _ = Command::new("/bin/kill")
        .args([signal, "--", process])
        .stderr(Stdio::null())
        .status();
}

/// A master of ROS: `rosmaster`, or `roscore` with its rosout.
pub(crate) struct RosMaster {
    pub(crate) port: u16,
    /// The process that answers; roscore starts it in a group of its own.
    pid: i32,
    running: Running,
}

impl Drop for RosMaster {
    /// Kills the master; roscore is interrupted, so that it ends its other children.
    fn drop(&mut self) {
        kill("-KILL", &self.pid.to_string());
        kill("-INT", &self.running.child.id().to_string());
        let asked = Instant::now();
        while matches!(self.running.child.try_wait(), Ok(None)) {
            if asked.elapsed() > Duration::from_secs(20) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl RosMaster {
    /// Starts it and waits until it answers.
    pub(crate) async fn start(program: &str, port: u16) -> Self {
        let mut command = command(program, port);
        if program == "rosmaster" {
            command.arg("--core");
        }
        command
            .args(["-p", &port.to_string()])
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let running = Running::start(command);
        let started = Instant::now();
        let pid = loop {
            if let Ok(pid) = call_ros(&uri(port), "getPid", &["/test".into()]).await {
                break pid.as_int().unwrap();
            }
            assert!(
                started.elapsed() < Duration::from_secs(30),
                "{program} does not come up"
            );
            tokio::time::sleep(Duration::from_millis(50)).await;
        };
        Self { port, pid, running }
    }

    pub(crate) fn uri(&self) -> String {
        uri(self.port)
    }
}

/// The URI of a master at `port` of this machine.
pub(crate) fn uri(port: u16) -> String {
    format!("http://127.0.0.1:{port}/")
}
