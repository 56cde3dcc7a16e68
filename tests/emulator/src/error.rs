//! Why an image was not built, did not run or did not end well.

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::time::Duration;

/// Each message states what failed, why, and what to do next.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// `qemu-system-arm` is not on the PATH.
    #[error(
        "QEMU is missing: `qemu-system-arm` does not start\n  next: `sudo apt-get install qemu-system-arm`"
    )]
    QemuMissing,
    /// The compiler has no `core` library for the microcontroller.
    #[error(
        "the standard library for {target} is missing: `rustc --print=target-libdir` names no folder\n  \
         next: `rustup target add {target}`",
        target = crate::machine::TARGET
    )]
    TargetMissing,
    /// Cargo failed; its own messages went to the standard error.
    #[error("`{command}` failed: {why}\n  next: read the compiler's message above")]
    Build {
        /// The command line of cargo.
        command: String,
        /// Cargo's exit status, or what its output lacked.
        why: String,
    },
    /// The image printed nothing for too long.
    #[error("the image failed: silent for {} s; it printed: {}\n  next: {next}", silence.as_secs(), lines.join(" / "))]
    Silent {
        /// Longest permitted time without a line.
        silence: Duration,
        /// Lines that the image had printed.
        lines: Vec<String>,
        /// How to run the image by hand.
        next: String,
    },
    /// The emulator or its image ended with an error.
    #[error("the image failed: {status}; it printed: {}\n  next: {next}", lines.join(" / "))]
    Failed {
        /// Exit status of the emulator.
        status: ExitStatus,
        /// Lines that the image had printed.
        lines: Vec<String>,
        /// How to run the image by hand.
        next: String,
    },
    /// The operating system refused to start or to await a program.
    #[error("`{program}` does not run: {error}\n  next: run it by hand")]
    Start {
        /// Name of the program.
        program: &'static str,
        /// The system's reason.
        error: io::Error,
    },
    /// A file of the run cannot be created, read or written.
    #[error("cannot use the file {}: {error}\n  next: is its folder writable, and the disk not full?", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        error: io::Error,
    },
}

impl EmulatorError {
    /// Whether something must be installed first, as opposed to a check that failed.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::QemuMissing | Self::TargetMissing)
    }

    /// Adds the path to an error of the file system; for `map_err`.
    pub fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        |error| Self::File { path, error }
    }
}
