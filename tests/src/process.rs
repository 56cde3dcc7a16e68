//! Programs that a test starts, none of which outlives it.

use std::fs::{self, File};
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process, kill_process_group, test_kill_process_group};

/// How often a condition is looked at.
const POLL: Duration = Duration::from_millis(20);

/// A running program in a process group of its own, with its output in two files.
///
/// Dropping it kills the group and every descendant: roscore's children have sessions of their own.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    output: PathBuf,
    errors: PathBuf,
}

impl Process {
    /// Starts the command; its output goes to `NAME.out` and `NAME.err` in `folder`.
    ///
    /// # Errors
    /// The program does not start, or the files cannot be made.
    pub fn start(name: &str, command: &mut Command, folder: &Path) -> io::Result<Self> {
        let output = folder.join(format!("{name}.out"));
        let errors = folder.join(format!("{name}.err"));
        let child = command
            .stdin(Stdio::null())
            .stdout(File::create(&output)?)
            .stderr(File::create(&errors)?)
            .process_group(0)
            .spawn()?;
        Ok(Self {
            name: name.to_owned(),
            child,
            output,
            errors,
        })
    }

    /// What it has printed on standard output so far.
    pub fn output(&self) -> String {
        fs::read_to_string(&self.output).unwrap_or_default()
    }

    /// What it has printed on standard error so far.
    pub fn errors(&self) -> String {
        fs::read_to_string(&self.errors).unwrap_or_default()
    }

    /// Whether it still runs.
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Sends a signal to the group and waits until the program has left, and then for what else is
    /// in the group: `rosbag record` ends before the recorder that it started has closed its bag.
    ///
    /// # Panics
    /// When it still runs after `patience`: leaving cleanly is part of what is tested.
    pub fn end(mut self, signal: Signal, patience: Duration) -> ExitStatus {
        self.signal(signal);
        let status = self.wait(patience);
        let end = Instant::now() + patience;
        while Instant::now() < end && self.group_lives() {
            std::thread::sleep(POLL);
        }
        status
    }

    /// Whether any process of the group is left.
    fn group_lives(&self) -> bool {
        test_kill_process_group(Pid::from_child(&self.child)).is_ok()
    }

    /// Kills the group and every descendant at once.
    pub fn kill(&mut self) {
        // Looked up before the parent dies: afterwards they are nobody's children.
        let descendants = descendants(self.child.id());
        self.signal(Signal::KILL);
        for pid in descendants.into_iter().filter_map(pid_of) {
            // One that has ended meanwhile is what we want.
            let _ = kill_process(pid, Signal::KILL);
        }
        // Reaps it; it cannot refuse.
        let _ = self.child.wait();
    }

    /// Waits until the program ends by itself.
    ///
    /// # Panics
    /// When it still runs after `patience`.
    pub fn wait(&mut self, patience: Duration) -> ExitStatus {
        let end = Instant::now() + patience;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return status,
                Ok(None) if Instant::now() < end => std::thread::sleep(POLL),
                other => panic!(
                    "`{}` has not ended after {patience:?} ({other:?}):\n{}",
                    self.name,
                    self.log()
                ),
            }
        }
    }

    /// Waits until `condition` holds while the program runs.
    ///
    /// # Panics
    /// When the program ends before, or `patience` does; the message has the program's output.
    pub fn wait_until(
        &mut self,
        what: &str,
        patience: Duration,
        mut condition: impl FnMut(&Self) -> bool,
    ) {
        let end = Instant::now() + patience;
        while !condition(self) {
            assert!(
                self.is_running(),
                "`{}` ended before {what}:\n{}",
                self.name,
                self.log()
            );
            assert!(
                Instant::now() < end,
                "{what}: not within {patience:?}:\n{}",
                self.log()
            );
            std::thread::sleep(POLL);
        }
    }

    /// Both outputs, for a message.
    pub fn log(&self) -> String {
        let (output, errors) = (self.output(), self.errors());
        format!(
            "--- {} output\n{}\n--- {} errors\n{errors}",
            self.name,
            tail(&output),
            self.name
        )
    }

    fn signal(&self, signal: Signal) {
        // A group that is gone already is what we want.
        let _ = kill_process_group(Pid::from_child(&self.child), signal);
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Children, their children, and so on, by `/proc`.
fn descendants(root: u32) -> Vec<u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let parents: Vec<(u32, u32)> = entries
        .filter_map(|entry| entry.file_name().to_string_lossy().parse().ok())
        .filter_map(|pid| Some((pid, parent(pid)?)))
        .collect();
    let mut found = vec![root];
    let mut next = 0;
    while let Some(parent) = found.get(next).copied() {
        found.extend(
            parents
                .iter()
                .filter(|(_, of)| *of == parent)
                .map(|(pid, _)| pid),
        );
        next += 1;
    }
    found.split_off(1)
}

/// Fourth field of `/proc/PID/stat`; the second, in brackets, may hold anything.
fn parent(pid: u32) -> Option<u32> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (_, rest) = stat.rsplit_once(')')?;
    rest.split_whitespace().nth(1)?.parse().ok()
}

fn pid_of(id: u32) -> Option<Pid> {
    Pid::from_raw(id.cast_signed())
}

/// The last lines: a subscriber prints one per frame.
fn tail(text: &str) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let last = lines.len().saturating_sub(20);
    lines[last..]
        .iter()
        .map(|line| line.chars().take(400).collect::<String>() + "\n")
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Duration = Duration::from_secs(10);

    fn shell(script: &str, folder: &Path) -> Process {
        Process::start("sh", Command::new("sh").args(["-c", script]), folder).expect("a shell")
    }

    fn runs(pid: i32) -> bool {
        // A zombie counts as gone.
        fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| !stat.contains(") Z "))
    }

    #[test]
    fn a_dropped_process_takes_its_children_along() {
        let folder = tempfile::tempdir().expect("a folder");
        // In a session of its own, as roscore starts its master.
        let mut process = shell(
            "setsid sleep 600 & sleep 0.2; pgrep -P $$ sleep; wait",
            folder.path(),
        );
        process.wait_until("the child's id", PATIENCE, |process| {
            process.output().ends_with('\n')
        });
        let child: i32 = process.output().trim().parse().expect("an id");
        assert!(runs(child));
        drop(process);
        let end = Instant::now() + PATIENCE;
        while runs(child) {
            assert!(Instant::now() < end, "the child still runs");
            std::thread::sleep(POLL);
        }
    }

    #[test]
    fn output_and_status_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut process = shell("echo out; echo err >&2; exit 3", folder.path());
        assert_eq!(process.wait(PATIENCE).code(), Some(3));
        assert_eq!(
            (process.output().as_str(), process.errors().as_str()),
            ("out\n", "err\n")
        );
    }
}
