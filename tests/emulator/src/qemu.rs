//! The two boards that QEMU emulates for tests and benchmarks, QEMU's command line, and the run of
//! an image.

use std::io::{self, BufRead, BufReader, ErrorKind};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use crate::error::EmulatorError;
use crate::image::Image;

/// Target triple for which images are built: Cortex-M4F, and Cortex-M7 with a single-precision FPU.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Name of the emulator's program and of its Debian package.
pub const QEMU: &str = "qemu-system-arm";

/// A board that QEMU can emulate.
#[derive(Debug, Clone, Copy)]
pub struct Machine {
    /// Name of the board for QEMU's option `-machine`.
    pub name: &'static str,
    /// Processor of the board, as reports name it: "Cortex-M4F".
    pub core: &'static str,
    /// Arguments of cargo that select the encoder's kernels for this processor.
    pub features: &'static [&'static str],
}

/// The emulated boards, with the smallest and the largest processor that the firmware supports.
pub const MACHINES: [Machine; 2] = [
    Machine { name: "mps2-an386", core: "Cortex-M4F", features: &[] },
    Machine { name: "mps2-an500", core: "Cortex-M7", features: &["--features=pipeline/cortex-m7"] },
];

/// What the first UART of the emulated board is connected to.
#[derive(Debug, Clone, Copy)]
pub enum Uart<'f> {
    /// Nothing; for an image that does not use the UART.
    None,
    /// A file of this name in the run's folder receives the image's output; there is no input.
    File(&'f str),
    /// The named pipes `NAME.in` (to the image) and `NAME.out` (from it) in the run's folder.
    Pipes(&'f str),
    /// A TCP server on this port of 127.0.0.1; the image starts without waiting for a client.
    Tcp(u16),
}

/// Command line with which QEMU runs an image; [`Qemu::run`] starts it.
#[derive(Debug)]
pub struct Qemu {
    command: Command,
}

impl Qemu {
    /// Prepares QEMU to run `image` on `machine` in the working folder `folder`. The image can read
    /// `arguments` through semihosting; the first argument is the image's own name.
    pub fn new(image: &Image, machine: Machine, folder: &Path, arguments: &[&str]) -> Self {
        let semihosting = [&["enable=on,target=native"], arguments].concat();
        let mut command = Command::new(QEMU);
        command
            .args(["-machine", machine.name])
            .args(["-display", "none", "-monitor", "none"])
            .args(["-semihosting-config", &semihosting.join(",arg=")])
            .arg("-kernel")
            .arg(image.path())
            .current_dir(folder)
            .stdin(Stdio::null());
        Self { command }
    }

    /// Sets virtual time to 2^`shift` ns per instruction. While the processor is idle, virtual time
    /// jumps to the next interrupt.
    pub fn instruction_time(&mut self, shift: u8) -> &mut Self {
        let icount = format!("shift={shift},sleep=off");
        self.command.args(["-icount", &icount]);
        self
    }

    /// Connects the first UART to `uart`; without this call, to QEMU's standard output.
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

    /// Returns the command that starts QEMU, for callers that manage the process themselves.
    pub fn into_command(self) -> Command {
        self.command
    }

    /// Runs the image to its end, calls `on_line` with each line that it prints, and returns all
    /// lines.
    ///
    /// # Errors
    /// QEMU is missing, the image prints nothing for longer than `silence`, or it ends with an
    /// error.
    pub fn run(
        &mut self,
        silence: Duration,
        mut on_line: impl FnMut(&str),
    ) -> Result<Vec<String>, EmulatorError> {
        let mut lines = Vec::new();
        let ended = pass_on(&mut self.command, silence, |line| {
            on_line(&line);
            lines.push(line);
        });
        let why = match ended {
            Ok(status) if status.success() => return Ok(lines),
            Ok(status) => status.to_string(),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                return Err(EmulatorError::QemuMissing);
            }
            Err(error) => error.to_string(),
        };
        Err(EmulatorError::Failed {
            why,
            output: lines.join(" / "),
            command: format!("{:?}", self.command),
        })
    }
}

/// Runs a command, calls `on_line` with each line of its standard output, and returns its exit
/// status. Kills a command that prints nothing for longer than `silence`.
fn pass_on(
    command: &mut Command,
    silence: Duration,
    mut on_line: impl FnMut(String),
) -> io::Result<ExitStatus> {
    let mut process = command.stdout(Stdio::piped()).spawn()?;
    let (sender, printed) = mpsc::channel();
    if let Some(output) = process.stdout.take() {
        thread::spawn(move || {
            let mut lines = BufReader::new(output).lines().map_while(Result::ok);
            lines.try_for_each(|line| sender.send(line))
        });
    }
    loop {
        match printed.recv_timeout(silence) {
            Ok(line) => on_line(line),
            Err(RecvTimeoutError::Disconnected) => return process.wait(),
            Err(RecvTimeoutError::Timeout) => {
                process.kill()?;
                process.wait()?;
                let seconds = silence.as_secs();
                return Err(io::Error::other(format!("silent for {seconds} s")));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs a program instead of QEMU: the first of `words`, with the others as arguments.
    fn run(words: &[&str], silence: Duration) -> Result<Vec<String>, EmulatorError> {
        let mut command = Command::new(words[0]);
        command.args(&words[1..]);
        Qemu { command }.run(silence, |line| print!("{line}"))
    }

    #[test]
    fn lines_are_returned_and_an_image_that_fails_or_is_silent_is_quoted() {
        let minute = Duration::from_mins(1);
        let lines = run(&["sh", "-c", "echo one; echo two"], minute);
        assert_eq!(lines.expect("status 0"), ["one", "two"]);
        let failed = run(&["sh", "-c", "echo lost; exit 3"], minute);
        let expected = "the image failed: exit status: 3; it printed: lost\n  next: run it by hand: \
                        `\"sh\" \"-c\" \"echo lost; exit 3\"`";
        assert_eq!(failed.expect_err("status 3").to_string(), expected);
        let silent = run(&["sh", "-c", "echo one; exec sleep 600"], Duration::from_millis(200));
        let message = silent.expect_err("it is ended").to_string();
        assert!(message.contains("silent for 0 s; it printed: one"), "{message}");
        let missing = run(&["corticode-no-such-emulator"], minute);
        assert!(missing.expect_err("no such program").is_missing());
    }
}
