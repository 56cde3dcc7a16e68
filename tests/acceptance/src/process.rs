//! Programs that a test starts; they are killed when the test ends.

use std::fs::{self, File};
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process, kill_process_group, test_kill_process_group};

/// Time limit for a program to exit or to reach a condition, enough on a busy machine.
pub const SLACK: Duration = Duration::from_mins(1);
/// Time between two checks whether a program has ended or a condition holds.
const POLL: Duration = Duration::from_millis(20);

/// A running program in its own process group; its standard output and standard error go to files.
///
/// Dropping the value kills the group and every descendant of the program. A descendant can be
/// outside the group: roscore starts its children in sessions of their own.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    output: PathBuf,
    errors: PathBuf,
}

impl Process {
    /// Starts `command`. Its standard output goes to `NAME.out` and its standard error to
    /// `NAME.err` in `folder`.
    ///
    /// # Errors
    /// The program does not start, or the files cannot be created.
    pub fn start(name: &str, command: &mut Command, folder: &Path) -> io::Result<Self> {
        let output = folder.join(format!("{name}.out"));
        let errors = folder.join(format!("{name}.err"));
        let child = command
            .stdin(Stdio::null())
            .stdout(File::create(&output)?)
            .stderr(File::create(&errors)?)
            .process_group(0)
            .spawn()?;
        Ok(Self { name: name.to_owned(), child, output, errors })
    }

    /// Returns the program's standard output so far.
    pub fn output(&self) -> String {
        fs::read_to_string(&self.output).unwrap_or_default()
    }

    /// Returns the program's standard error so far.
    pub fn errors(&self) -> String {
        fs::read_to_string(&self.errors).unwrap_or_default()
    }

    /// Returns whether the program itself still runs; its children are not considered.
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Sends `signal` to the group, and waits until the program and then every other process of the
    /// group has ended: `rosbag record` ends before the process that it has started to write the
    /// bag.
    ///
    /// # Panics
    /// When the program still runs after `timeout`: a test fails if a program does not end cleanly.
    pub fn stop(mut self, signal: Signal, timeout: Duration) -> ExitStatus {
        self.signal(signal);
        let status = self.wait(timeout);
        let end = Instant::now() + timeout;
        while Instant::now() < end && self.group_is_running() {
            std::thread::sleep(POLL);
        }
        status
    }

    /// Returns whether any process of the group still runs.
    fn group_is_running(&self) -> bool {
        test_kill_process_group(Pid::from_child(&self.child)).is_ok()
    }

    /// Kills the group and every descendant with SIGKILL.
    pub fn kill(&mut self) {
        // List the descendants before the kill, because the children of a process that has ended
        // get another parent.
        let descendants = descendants(self.child.id());
        self.signal(Signal::KILL);
        for pid in descendants.into_iter().filter_map(pid_of) {
            // Ignore the error that a descendant which has already ended causes.
            let _ = kill_process(pid, Signal::KILL);
        }
        // Wait for the killed program, so that it does not remain as a zombie.
        let _ = self.child.wait();
    }

    /// Waits until the program ends by itself.
    ///
    /// # Panics
    /// When the program still runs after `timeout`.
    pub fn wait(&mut self, timeout: Duration) -> ExitStatus {
        let end = Instant::now() + timeout;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return status,
                Ok(None) if Instant::now() < end => std::thread::sleep(POLL),
                other => panic!(
                    "`{}` has not ended after {timeout:?} ({other:?}):\n{}",
                    self.name,
                    self.log()
                ),
            }
        }
    }

    /// Waits until `condition` holds; `what` describes the condition in messages.
    ///
    /// # Panics
    /// When the program ends or `timeout` passes first; the message contains the program's output.
    pub fn wait_until(
        &mut self,
        what: &str,
        timeout: Duration,
        mut condition: impl FnMut(&Self) -> bool,
    ) {
        let end = Instant::now() + timeout;
        while !condition(self) {
            assert!(self.is_running(), "`{}` ended before {what}:\n{}", self.name, self.log());
            assert!(Instant::now() < end, "{what}: not within {timeout:?}:\n{}", self.log());
            std::thread::sleep(POLL);
        }
    }

    /// Returns the last lines of the program's output and errors, for a test's message.
    pub fn log(&self) -> String {
        let (output, errors) = (self.output(), self.errors());
        format!("--- {} output\n{}\n--- {} errors\n{errors}", self.name, tail(&output), self.name)
    }

    /// Sends the Unix signal `signal` to the program's group.
    pub fn signal(&self, signal: Signal) {
        // Ignore the error that occurs when the whole group has already ended.
        let _ = kill_process_group(Pid::from_child(&self.child), signal);
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Waits until `condition` holds; `what` describes it in messages.
///
/// # Panics
/// When [`SLACK`] passes first.
pub fn wait_for(what: &str, condition: impl Fn() -> bool) {
    let end = Instant::now() + SLACK;
    while !condition() {
        assert!(Instant::now() < end, "{what}: not within {SLACK:?}");
        std::thread::sleep(POLL);
    }
}

/// Returns the ids of all descendants of the process `root`, as `/proc` lists them.
fn descendants(root: u32) -> Vec<u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let parents: Vec<(u32, u32)> = entries
        .filter_map(|entry| entry.file_name().to_string_lossy().parse().ok())
        .filter_map(|pid| Some((pid, parent(pid)?)))
        .collect();
    let mut found = vec![root];
    let mut next = 0;
    while let Some(parent) = found.get(next).copied() {
        found.extend(parents.iter().filter(|(_, of)| *of == parent).map(|(pid, _)| pid));
        next += 1;
    }
    found.split_off(1)
}

/// Returns the id of a process's parent, the fourth field of `/proc/PID/stat`. The search starts
/// after the second field, whose parentheses can enclose any characters.
fn parent(pid: u32) -> Option<u32> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (_, rest) = stat.rsplit_once(')')?;
    rest.split_whitespace().nth(1)?.parse().ok()
}

fn pid_of(id: u32) -> Option<Pid> {
    Pid::from_raw(id.cast_signed())
}

/// Returns the last 20 lines of `text`, each cut to 400 characters, because a subscriber prints one
/// long line per frame.
fn tail(text: &str) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let last = lines.len().saturating_sub(20);
    lines[last..].iter().map(|line| line.chars().take(400).collect::<String>() + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_secs(10);

    fn shell(script: &str, folder: &Path) -> Process {
        Process::start("sh", Command::new("sh").args(["-c", script]), folder).expect("a shell")
    }

    fn runs(pid: i32) -> bool {
        // A process whose state is Z, a zombie, has already ended.
        fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| !stat.contains(") Z "))
    }

    #[test]
    fn dropping_a_process_kills_its_children() {
        let folder = tempfile::tempdir().expect("a folder");
        // The shell's child gets a session of its own, as the master that roscore starts does.
        let mut process =
            shell("setsid sleep 600 & sleep 0.2; pgrep -P $$ sleep; wait", folder.path());
        process.wait_until("the child's id", TIMEOUT, |process| process.output().ends_with('\n'));
        let child: i32 = process.output().trim().parse().expect("an id");
        assert!(runs(child));
        drop(process);
        let end = Instant::now() + TIMEOUT;
        while runs(child) {
            assert!(Instant::now() < end, "the child still runs");
            std::thread::sleep(POLL);
        }
    }

    #[test]
    fn output_and_status_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut process = shell("echo out; echo err >&2; exit 3", folder.path());
        assert_eq!(process.wait(TIMEOUT).code(), Some(3));
        assert_eq!((process.output().as_str(), process.errors().as_str()), ("out\n", "err\n"));
    }
}
