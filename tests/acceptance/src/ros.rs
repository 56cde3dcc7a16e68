//! Debian's ROS 1: its master and its command-line tools, each run as a separate process.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use emulator::skip::skip_unless_required;

use crate::port::free_port;
use crate::process::Process;
use crate::ros_messages;

/// Search path with Debian's programs only, because another Python on the PATH may lack rospy.
const PATH: &str = "/usr/bin:/bin:/usr/sbin:/sbin";

/// Time limit for an action such as a start or a run of 20 s, after which it counts as hung. Other
/// tests build programs meanwhile, so an action can take many times its usual time.
pub const TIMEOUT: Duration = Duration::from_mins(3);

/// Returns whether ROS is installed; reports `test` as skipped if it is not.
///
/// # Panics
/// When ROS is not installed and `CORTICODE_REQUIRE_ROS=1`.
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
    skip_unless_required(test, why);
    false
}

fn installed(tool: &str) -> bool {
    Path::new("/usr/bin").join(tool).exists()
}

/// A ROS master on a free port, and the environment of commands that use it.
#[derive(Debug)]
pub struct Ros<'a> {
    port: u16,
    folder: &'a Path,
    core: Process,
    starts: u32,
}

impl<'a> Ros<'a> {
    /// Generates the Python message classes in `folder` and starts roscore, which also writes its
    /// logs to `folder`.
    ///
    /// # Errors
    /// There is no free port, or roscore does not start.
    pub fn start(folder: &'a Path) -> io::Result<Self> {
        ros_messages::generate(folder);
        let port = free_port()?;
        let core = start_core(port, folder, 0)?;
        Ok(Self { port, folder, core, starts: 1 })
    }

    /// Like [`Self::start`], but starts the ROS master of `corticode-bridge`, the program at the
    /// path `bridge`, instead of roscore.
    ///
    /// # Errors
    /// There is no free port, or the master does not start.
    pub fn start_master_of(bridge: &Path, folder: &'a Path) -> io::Result<Self> {
        ros_messages::generate(folder);
        let port = free_port()?;
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let mut master = Command::new(bridge);
        master.args(["master", "--bind", &address.to_string()]);
        let mut core = Process::start("master", &mut master, folder)?;
        core.wait_until("the master listens", TIMEOUT, |_| TcpStream::connect(address).is_ok());
        Ok(Self { port, folder, core, starts: 1 })
    }

    /// Returns the master's address in the format of the environment variable `ROS_MASTER_URI`.
    pub fn master_uri(&self) -> String {
        master_uri(self.port)
    }

    /// Kills the master and every process that roscore has started.
    pub fn kill_core(&mut self) {
        self.core.kill();
    }

    /// Kills the master and starts a new roscore on the same port.
    ///
    /// # Errors
    /// The new master does not start.
    pub fn restart_core(&mut self) -> io::Result<()> {
        self.kill_core();
        self.core = start_core(self.port, self.folder, self.starts)?;
        self.starts += 1;
        Ok(())
    }

    /// Returns a command that runs one of Debian's programs in an environment that names this
    /// master.
    pub fn command(&self, program: &str) -> Command {
        command(program, self.port, self.folder)
    }

    /// Runs one of Debian's programs until it ends, and returns its standard output.
    ///
    /// # Panics
    /// When the program does not start or fails.
    pub fn tool(&self, program: &str, arguments: &[&str]) -> String {
        let output: Output =
            self.command(program).args(arguments).output().expect("the tool starts");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program} {arguments:?}: {text}\n{errors}");
        text
    }
}

fn start_core(port: u16, folder: &Path, number: u32) -> io::Result<Process> {
    let mut roscore = command("roscore", port, folder);
    roscore.args(["-p", &port.to_string()]);
    let mut core = Process::start(&format!("roscore{number}"), &mut roscore, folder)?;
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    core.wait_until("roscore has started its log node", TIMEOUT, |core| {
        // Wait for the log node, rosout, which starts last; the master's port is open earlier.
        core.output().contains("started core service") && TcpStream::connect(address).is_ok()
    });
    Ok(core)
}

fn command(program: &str, port: u16, folder: &Path) -> Command {
    // Restore the default action of SIGINT. A shell starts background jobs with SIGINT ignored, and
    // their children inherit this; `rosbag record` would then not close its bag.
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
