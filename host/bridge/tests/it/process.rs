//! The bridge as a child process of a test.

use std::io::{BufRead, BufReader, Read};
use std::net::{SocketAddr, TcpListener};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Timeout of every wait in these tests, sufficient for a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(30);

/// A running bridge process, which is killed when this value is dropped.
pub(crate) struct Bridge {
    child: Child,
}

impl Bridge {
    pub(crate) fn start(arguments: &[&str]) -> Bridge {
        Bridge::start_with(arguments, &[])
    }

    /// Starts the bridge for the board at `port`; it prints frames as lines of JSON on stdout.
    pub(crate) fn ndjson(port: &str) -> Bridge {
        Bridge::start(&["--port", port, "--sink", "ndjson"])
    }

    /// Starts the bridge with additional environment variables.
    pub(crate) fn start_with(arguments: &[&str], variables: &[(&str, &str)]) -> Bridge {
        Bridge::spawn(arguments, variables, Stdio::piped())
    }

    fn spawn(arguments: &[&str], variables: &[(&str, &str)], stdout: Stdio) -> Bridge {
        Bridge::spawn_command(&mut Bridge::command(arguments, variables, stdout))
    }

    /// Starts a command that in turn runs the bridge.
    pub(crate) fn spawn_command(command: &mut Command) -> Bridge {
        Bridge { child: command.spawn().unwrap() }
    }

    fn command(arguments: &[&str], variables: &[(&str, &str)], stdout: Stdio) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_corticode-bridge"));
        for variable in ["ROS_MASTER_URI", "ROS_NAMESPACE", "ROS_HOSTNAME", "RUST_LOG"] {
            command.env_remove(variable);
        }
        command.env("ROS_IP", "127.0.0.1").args(arguments);
        // Ignore the configuration file of the user who runs the tests.
        command.env("CORTICODE_CONFIG", "/dev/null");
        command.envs(variables.iter().copied());
        command.stdin(Stdio::null()).stdout(stdout).stderr(Stdio::piped());
        command
    }

    /// Starts the bridge with the configuration file in a user's folder. `home` is the environment
    /// variable that names this folder, and its value.
    pub(crate) fn start_in_home(arguments: &[&str], home: (&str, &str)) -> Bridge {
        let mut command = Bridge::command(arguments, &[home], Stdio::piped());
        Bridge::spawn_command(command.env_remove("CORTICODE_CONFIG"))
    }

    /// Starts the bridge with its stdout going to a file.
    pub(crate) fn start_into(file: std::fs::File, arguments: &[&str]) -> Bridge {
        Bridge::spawn(arguments, &[], file.into())
    }

    /// Starts the bridge with a limit on the length of files, 32 blocks of 512 or 1024 bytes, which
    /// simulates a full disk.
    pub(crate) fn start_on_full_disk(arguments: &[&str], stdout: Stdio) -> Bridge {
        // Without the `trap`, the kernel would kill the program with SIGXFSZ.
        let script = "trap '' XFSZ; ulimit -f 32; exec \"$@\"";
        let mut command = Command::new("sh");
        command
            .args(["-c", script, "sh", env!("CARGO_BIN_EXE_corticode-bridge")])
            .args(arguments)
            .env("CORTICODE_CONFIG", "/dev/null")
            .stdin(Stdio::null())
            .stdout(stdout)
            .stderr(Stdio::piped())
            .process_group(0);
        Bridge::spawn_command(&mut command)
    }

    pub(crate) fn stdout(&mut self) -> std::process::ChildStdout {
        self.child.stdout.take().unwrap()
    }

    /// Returns the topic and message in each line of JSON on stdout.
    pub(crate) fn messages(&mut self) -> impl Iterator<Item = (String, Value)> + Send + use<> {
        let lines = BufReader::new(self.stdout()).lines();
        lines.map_while(Result::ok).map(|line| {
            let mut line: Value = serde_json::from_str(&line).unwrap();
            let topic = line["topic"].as_str().unwrap().to_owned();
            (topic, line["message"].take())
        })
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(i32::try_from(self.child.id()).unwrap()).unwrap();
        kill_process(pid, signal).unwrap();
    }

    /// Waits until the bridge exits. Returns the exit status and its output on stderr.
    pub(crate) fn wait(mut self) -> (ExitStatus, String) {
        let mut status = None;
        wait_until("the end of the bridge", || {
            status = self.child.try_wait().unwrap();
            status.is_some()
        });
        let mut text = String::new();
        let mut stderr = self.child.stderr.take().unwrap();
        stderr.read_to_string(&mut text).unwrap();
        (status.unwrap(), text)
    }

    /// Waits until the bridge exits. Returns exit status, stdout and stderr.
    pub(crate) fn output(mut self) -> (Option<i32>, String, String) {
        let text = std::io::read_to_string(self.stdout()).unwrap();
        let (status, log) = self.wait();
        (status.code(), text, log)
    }

    /// Waits until the bridge exits with status 0. Returns its output on stderr.
    #[track_caller]
    pub(crate) fn success(self) -> String {
        self.failure(0)
    }

    /// Waits until the bridge exits with status `status`. Returns its output on stderr.
    #[track_caller]
    pub(crate) fn failure(self, status: i32) -> String {
        let (ended, log) = self.wait();
        assert_eq!(ended.code(), Some(status), "{log}");
        log
    }

    /// Sends a Unix signal, which must end the bridge with status 0. Returns its output on stderr.
    #[track_caller]
    pub(crate) fn end(self, signal: Signal) -> String {
        self.signal(signal);
        self.success()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the value of `key` in the status `corticode: NAME` of a report on `/diagnostics`.
pub(crate) fn figure<'r>(report: &'r Value, name: &str, key: &str) -> Option<&'r str> {
    let name = format!("corticode: {name}");
    let mut statuses = report["status"].as_array()?.iter();
    let status = statuses.find(|status| status["name"] == name.as_str())?;
    let mut values = status["values"].as_array()?.iter();
    values.find(|value| value["key"] == key)?["value"].as_str()
}

/// Returns an address of this machine at which no program listens.
pub(crate) fn free_address() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap()
}

/// Listens on a free TCP port and passes each client to `serve`, in a thread. Returns the port.
pub(crate) fn serve(mut serve: impl FnMut(std::net::TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || listener.incoming().flatten().for_each(&mut serve));
    port
}

/// Waits until the file at `path` has at least `bytes` bytes.
pub(crate) fn wait_for_bytes(path: &Path, bytes: u64) {
    wait_until("the recording", || std::fs::metadata(path).is_ok_and(|file| file.len() >= bytes));
}

pub(crate) fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + TIMEOUT;
    while !holds() {
        assert!(Instant::now() < deadline, "{what}: not within {TIMEOUT:?}");
        std::thread::sleep(Duration::from_millis(1));
    }
}
