//! QEMU: the two machines, an image for them, and a run of it.

use std::io::{self, BufRead, BufReader, ErrorKind};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use crate::command::{cargo_with, run, typed};
use crate::debian;
use crate::failure::Failure;
use crate::verify;

/// A machine that QEMU emulates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Machine {
    /// QEMU's name.
    pub(crate) name: &'static str,
    /// Its processor.
    pub(crate) core: &'static str,
    /// What cargo is told so that kernels are those for this processor.
    pub(crate) features: &'static [&'static str],
}

/// The machines: the small and the large processor that the firmware is meant for.
pub(crate) const MACHINES: [Machine; 2] = [
    Machine {
        name: "mps2-an386",
        core: "Cortex-M4F",
        features: &[],
    },
    Machine {
        name: "mps2-an500",
        core: "Cortex-M7",
        features: &["--features=pipeline/cortex-m7"],
    },
];

/// Debian's package with `qemu-system-arm`.
pub(crate) const PACKAGE: &str = "qemu-system-arm";

/// An image for these machines.
#[derive(Debug)]
pub(crate) struct Image {
    path: PathBuf,
    target_folder: PathBuf,
}

impl Image {
    /// Builds a package's image of this name; `features` as cargo takes them.
    ///
    /// # Errors
    /// The target is missing, or the image does not build.
    pub(crate) fn build(package: &str, name: &str, features: &[&str]) -> Result<Self, Failure> {
        verify::board_target()?;
        let package = format!("--package={package}");
        let target = format!("--target={}", verify::BOARD_TARGET);
        let bin = format!("--bin={name}");
        let arguments = ["build", &package, "--profile=firmware", &target, &bin];
        run(
            cargo_with(&arguments).args(features),
            "read the compiler's message above",
        )?;
        let target_folder = target_folder()?;
        let path = target_folder
            .join(verify::BOARD_TARGET)
            .join("firmware")
            .join(name);
        Ok(Self {
            path,
            target_folder,
        })
    }

    /// The linked program.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// A changed copy of it, which lies elsewhere.
    pub(crate) fn copied_to(&self, path: PathBuf) -> Self {
        Self {
            path,
            target_folder: self.target_folder.clone(),
        }
    }

    /// Cargo's target folder.
    pub(crate) fn target_folder(&self) -> &Path {
        &self.target_folder
    }

    /// QEMU with this image, to be run in `folder`; clock and UART are the caller's. The image can
    /// ask for the `words`.
    pub(crate) fn command(&self, machine: Machine, folder: &Path, words: &[&str]) -> Command {
        let semihosting = [&["enable=on,target=native"], words].concat();
        let mut command = Command::new("qemu-system-arm");
        command
            .args(["-machine", machine.name])
            .args(["-display", "none", "-monitor", "none"])
            .arg("-semihosting-config")
            .arg(semihosting.join(",arg="))
            .arg("-kernel")
            .arg(&self.path)
            .current_dir(folder)
            .stdin(Stdio::null());
        command
    }
}

/// Runs QEMU, or what else runs an image, to the end of its image, which is silent for no longer than
/// `patience`; calls `heard` with each line that the image says, and gives them all.
///
/// # Errors
/// QEMU is missing; the image says that something is wrong, or nothing for too long.
pub(crate) fn run_to_end(
    command: &mut Command,
    patience: Duration,
    mut heard: impl FnMut(&str),
) -> Result<Vec<String>, Failure> {
    let spawned = command.stdout(Stdio::piped()).spawn();
    let mut emulator = Emulator(spawned.map_err(|error| not_started(command, &error))?);
    let failed = |why: String| failed(command, why);
    let lines = emulator.lines();
    let mut said = Vec::new();
    loop {
        match lines.recv_timeout(patience) {
            Ok(line) => {
                heard(&line);
                said.push(line);
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => break,
            Err(mpsc::RecvTimeoutError::Timeout) => {
                let why = format!(
                    "silent for {} s; it said: {}",
                    patience.as_secs(),
                    said.join(" / ")
                );
                return Err(failed(why));
            }
        }
    }
    match emulator.0.wait() {
        Ok(status) if status.success() => Ok(said),
        Ok(status) => Err(failed(format!("{status}; it said: {}", said.join(" / ")))),
        Err(error) => Err(failed(error.to_string())),
    }
}

/// QEMU that does not start: it is missing, or the system refuses.
pub(crate) fn not_started(command: &Command, error: &io::Error) -> Failure {
    match error.kind() {
        ErrorKind::NotFound => missing(),
        _ => failed(command, error.to_string()),
    }
}

/// A run that came to no good end; says how to see it again.
pub(crate) fn failed(command: &Command, why: String) -> Failure {
    let folder = command.get_current_dir().unwrap_or(Path::new("."));
    Failure::Check {
        what: "the image".to_owned(),
        why,
        next: format!(
            "run it by hand in {}: `{}`",
            folder.display(),
            typed(command)
        ),
    }
}

/// A running QEMU; ended when it is dropped.
struct Emulator(Child);

impl Emulator {
    /// What the image says, line by line, until it ends.
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

impl Drop for Emulator {
    fn drop(&mut self) {
        // Both fail when it has ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn missing() -> Failure {
    Failure::Missing {
        what: "QEMU".to_owned(),
        why: "`qemu-system-arm` does not start".to_owned(),
        next: format!("`{}`", debian::install_line(&[PACKAGE])),
    }
}

/// Cargo's target folder: this program lies in a folder of it, since cargo put it there.
pub(crate) fn target_folder() -> Result<PathBuf, Failure> {
    let missing = |why: String| Failure::Missing {
        what: "the folder of the built image".to_owned(),
        why,
        next: "`cargo xtask`, not the program itself".to_owned(),
    };
    let own = std::env::current_exe().map_err(|error| missing(error.to_string()))?;
    let target = own.parent().and_then(Path::parent).map(Path::to_owned);
    target.ok_or_else(|| missing(own.display().to_string()))
}
