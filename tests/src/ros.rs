//! Debian's ROS 1: its master and its tools, each as a process of its own.

use std::env;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use crate::process::Process;
use crate::ros_messages;
use crate::skip::skipped;

/// Debian's own Python and tools come first: another Python has no rospy.
const PATH: &str = "/usr/bin:/bin:/usr/sbin:/sbin";

/// How long a busy machine may take for what takes 2 s.
pub const PATIENCE: Duration = Duration::from_mins(1);

/// Whether there is a ROS to test against; says loudly that `test` is skipped when there is not.
///
/// # Panics
/// When there is none and `CORTICODE_REQUIRE_ROS=1`.
pub fn available(test: &str) -> bool {
    let missing: Vec<&str> = ["roscore", "rostopic", "rosservice", "rosbag"]
        .into_iter()
        .filter(|tool| !installed(tool))
        .collect();
    if missing.is_empty() {
        return true;
    }
    let why = format!(
        "no {} in /usr/bin; `apt-get install ros-core python3-std-srvs python3-numpy`",
        missing.join(", ")
    );
    let required = env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(
        !required,
        "{test}: CORTICODE_REQUIRE_ROS=1, and there is {why}"
    );
    skipped(test, &why);
    false
}

fn installed(tool: &str) -> bool {
    Path::new("/usr/bin").join(tool).exists()
}

/// A roscore on a port of its own, and commands that know it.
#[derive(Debug)]
pub struct Ros<'a> {
    port: u16,
    folder: &'a Path,
    core: Process,
    starts: u32,
}

impl<'a> Ros<'a> {
    /// Starts roscore; its logs go under `folder`.
    ///
    /// # Errors
    /// No free port, or it does not start.
    pub fn start(folder: &'a Path) -> io::Result<Self> {
        ros_messages::generate(folder);
        let port = free_port()?;
        let core = start_core(port, folder, 0)?;
        Ok(Self {
            port,
            folder,
            core,
            starts: 1,
        })
    }

    /// Where the master is.
    pub fn master_uri(&self) -> String {
        master_uri(self.port)
    }

    /// Kills the master and all that roscore started.
    pub fn kill_core(&mut self) {
        self.core.kill();
    }

    /// Starts a new master where the old one was.
    ///
    /// # Errors
    /// It does not start.
    pub fn restart_core(&mut self) -> io::Result<()> {
        self.kill_core();
        self.core = start_core(self.port, self.folder, self.starts)?;
        self.starts += 1;
        Ok(())
    }

    /// A program of Debian's, or a script for Debian's Python, in this ROS's environment.
    pub fn command(&self, program: &str) -> Command {
        command(program, self.port, self.folder)
    }

    /// Runs a tool to its end.
    ///
    /// # Panics
    /// When it does not start or ends with another status than 0.
    pub fn tool(&self, program: &str, arguments: &[&str]) -> String {
        let output: Output = self
            .command(program)
            .args(arguments)
            .output()
            .expect("the tool starts");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success(),
            "{program} {arguments:?}: {text}\n{errors}"
        );
        text
    }
}

fn start_core(port: u16, folder: &Path, number: u32) -> io::Result<Process> {
    let mut roscore = command("roscore", port, folder);
    roscore.args(["-p", &port.to_string()]);
    let mut core = Process::start(&format!("roscore{number}"), &mut roscore, folder)?;
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    core.wait_until("roscore has started its log node", PATIENCE, |core| {
        // rosout is the last that it starts; the port alone opens earlier.
        core.output().contains("started core service") && TcpStream::connect(address).is_ok()
    });
    Ok(core)
}

fn command(program: &str, port: u16, folder: &Path) -> Command {
    // A shell starts background jobs with SIGINT ignored, its children inherit that, and `rosbag
    // record` would then not close its bag.
    let mut command = Command::new("env");
    command
        .args(["--default-signal=INT", program])
        .current_dir(folder)
        .env_clear()
        .env("PATH", PATH)
        .env("HOME", folder)
        .env("ROS_HOME", folder.join("ros"))
        .env("PYTHONPATH", folder.join("python"))
        .env("ROS_MASTER_URI", master_uri(port))
        .env("ROS_HOSTNAME", "127.0.0.1")
        .env("PYTHONUNBUFFERED", "1");
    command
}

fn master_uri(port: u16) -> String {
    format!("http://127.0.0.1:{port}/")
}

/// A TCP port of 127.0.0.1 that nobody listens at.
///
/// # Errors
/// The system has none.
pub fn free_port() -> io::Result<u16> {
    Ok(TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?
        .local_addr()?
        .port())
}
