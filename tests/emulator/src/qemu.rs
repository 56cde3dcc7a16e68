//! QEMU's command line, and a run with it.

use std::fmt;
use std::io::{BufRead, BufReader, ErrorKind};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use crate::error::EmulatorError;
use crate::image::Image;
use crate::machine::{Machine, QEMU};

/// Where the emulated board's first UART is connected.
#[derive(Debug, Clone, Copy)]
pub enum Uart<'f> {
    /// Not connected; the image does not use the UART.
    None,
    /// To a file of this name in the run's folder; the image receives nothing.
    File(&'f str),
    /// Through the named pipes `NAME.in` and `NAME.out` in the run's folder.
    Pipes(&'f str),
    /// A TCP server on 127.0.0.1 at this port; the image starts without waiting for a client.
    Tcp(u16),
}

/// Command line of QEMU with an image; [`Qemu::run`] starts it.
#[derive(Debug)]
pub struct Qemu {
    command: Command,
}

impl Qemu {
    /// Prepares QEMU with an image, to be run in `folder`; the image can read `arguments`, the first of which is
    /// its own name, through semihosting.
    pub fn new(image: &Image, machine: Machine, folder: &Path, arguments: &[&str]) -> Self {
        let semihosting = [&["enable=on,target=native"], arguments].concat();
        let mut command = Command::new(QEMU);
        command
            .args(["-machine", machine.name])
            .args(["-display", "none", "-monitor", "none"])
            .arg("-semihosting-config")
            .arg(semihosting.join(",arg="))
            .arg("-kernel")
            .arg(image.path())
            .current_dir(folder)
            .stdin(Stdio::null());
        Self { command }
    }

    /// Counts virtual time in instructions of 2^`shift` ns each; an idle processor skips to its next interrupt.
    pub fn instruction_time(&mut self, shift: u8) -> &mut Self {
        let icount = format!("shift={shift},sleep=off");
        self.command.args(["-icount", &icount]);
        self
    }

    /// Connects the first UART; without this call QEMU connects it to the standard output.
    pub fn uart(&mut self, uart: Uart<'_>) -> &mut Self {
        let serial = match uart {
            Uart::None => "none".to_owned(),
            Uart::File(name) => format!("file:{name}"),
            Uart::Pipes(name) => format!("pipe:{name}"),
            Uart::Tcp(port) => format!("tcp:127.0.0.1:{port},server=on,wait=off"),
        };
        self.command.args(["-serial", &serial]);
        self
    }

    /// Returns the prepared command, for a caller that manages the process itself.
    pub fn into_command(self) -> Command {
        self.command
    }

    /// Runs the image to its end, calls `on_line` with each line that it prints, and returns all lines.
    ///
    /// # Errors
    /// QEMU is missing, the image prints nothing for longer than `silence`, or it ends with an error.
    pub fn run(
        &mut self,
        silence: Duration,
        on_line: impl FnMut(&str),
    ) -> Result<Vec<String>, EmulatorError> {
        run_to_end(&mut self.command, silence, on_line)
    }
}

impl fmt::Display for Qemu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&as_typed(&self.command))
    }
}

/// Runs QEMU, or in tests a shell, as [`Qemu::run`] describes.
fn run_to_end(
    command: &mut Command,
    silence: Duration,
    mut on_line: impl FnMut(&str),
) -> Result<Vec<String>, EmulatorError> {
    let folder = command.get_current_dir().unwrap_or(Path::new("."));
    let next = format!(
        "run it by hand in {}: `{}`",
        folder.display(),
        as_typed(command)
    );
    let failed = |why: String, lines: &[String], next: String| EmulatorError::Failed {
        why,
        output: lines.join(" / "),
        next,
    };
    let mut emulator = match command.stdout(Stdio::piped()).spawn() {
        Ok(child) => Running(child),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return Err(EmulatorError::QemuMissing);
        }
        Err(error) => return Err(failed(error.to_string(), &[], next)),
    };
    let printed = emulator.lines();
    let mut lines = Vec::new();
    loop {
        match printed.recv_timeout(silence) {
            Ok(line) => {
                on_line(&line);
                lines.push(line);
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => break,
            Err(mpsc::RecvTimeoutError::Timeout) => {
                return Err(EmulatorError::Silent {
                    silence,
                    output: lines.join(" / "),
                    next,
                });
            }
        }
    }
    match emulator.0.wait() {
        Ok(status) if status.success() => Ok(lines),
        Ok(status) => Err(failed(status.to_string(), &lines, next)),
        Err(error) => Err(failed(error.to_string(), &lines, next)),
    }
}

/// Returns the command line as typed in a shell, for arguments without blanks.
fn as_typed(command: &Command) -> String {
    let words = [command.get_program()]
        .into_iter()
        .chain(command.get_args());
    let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
    words.join(" ")
}

/// A started process; dropping it ends the process.
struct Running(Child);

impl Running {
    /// Lines of the standard output; the channel closes when the process closes it.
    fn lines(&mut self) -> mpsc::Receiver<String> {
        let (sender, receiver) = mpsc::channel();
        if let Some(output) = self.0.stdout.take() {
            thread::spawn(move || {
                let mut lines = BufReader::new(output).lines().map_while(Result::ok);
                lines.try_for_each(|line| sender.send(line))
            });
        }
        receiver
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Both calls fail when the process has already ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SILENCE: Duration = Duration::from_mins(1);

    fn shell(script: &str, silence: Duration) -> Result<Vec<String>, EmulatorError> {
        run_to_end(Command::new("sh").args(["-c", script]), silence, |_| ())
    }

    #[test]
    fn lines_are_passed_on_and_returned() {
        let mut passed_on = Vec::new();
        let mut command = Command::new("sh");
        command.args(["-c", "echo one; echo two"]);
        let lines = run_to_end(&mut command, SILENCE, |line| {
            passed_on.push(line.to_owned());
        });
        assert_eq!(lines.expect("it ends well"), ["one", "two"]);
        assert_eq!(passed_on, ["one", "two"]);
    }

    #[test]
    fn an_image_that_fails_is_quoted_with_how_to_repeat_its_run() {
        let error = shell("echo lost; exit 3", SILENCE).expect_err("status 3");
        let text = error.to_string();
        for words in ["exit status: 3", "it printed: lost", "by hand in .: `sh -c"] {
            assert!(text.contains(words), "{text}");
        }
    }

    #[test]
    fn a_silent_image_is_ended() {
        let error = shell("echo one; exec sleep 600", Duration::from_millis(200));
        assert!(matches!(
            error,
            Err(EmulatorError::Silent { output, .. }) if output == "one"
        ));
    }

    #[test]
    fn a_program_that_does_not_exist_is_reported_as_missing() {
        let mut command = Command::new("corticode-no-such-emulator");
        let error = run_to_end(&mut command, SILENCE, |_| ()).expect_err("no such program");
        assert!(error.is_missing(), "{error}");
    }
}
