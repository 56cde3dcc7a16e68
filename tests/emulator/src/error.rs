//! Reasons why an image was not built, did not run or did not end well.

use std::io;
use std::path::{Path, PathBuf};
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
        /// Command line of cargo, as typed in a shell.
        command: String,
        /// Exit status of cargo, or what its output lacked.
        why: String,
    },
    /// The image printed no line for too long, and was ended.
    #[error("the image failed: silent for {} s; it printed: {output}\n  next: {next}", silence.as_secs())]
    Silent {
        /// Longest permitted time without a line.
        silence: Duration,
        /// Lines printed before the silence, separated by slashes.
        output: String,
        /// How to repeat the run by hand.
        next: String,
    },
    /// The emulator did not start, or it or its image ended with an error.
    #[error("the image failed: {why}; it printed: {output}\n  next: {next}")]
    Failed {
        /// Exit status of the emulator, or the reason of the operating system.
        why: String,
        /// All printed lines, separated by slashes.
        output: String,
        /// How to repeat the run by hand.
        next: String,
    },
    /// A file of the run cannot be created, read or written.
    #[error("cannot use the file {}: {error}\n  next: is its folder writable, and the disk not full?", path.display())]
    File {
        /// The file, or the folder for it.
        path: PathBuf,
        /// Reason of the operating system.
        error: io::Error,
    },
}

impl EmulatorError {
    /// Returns whether something must be installed first, as opposed to a check that failed.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::QemuMissing | Self::TargetMissing)
    }

    /// Adds the path to an error of the file system; an argument for `map_err`.
    pub fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        |error| Self::File { path, error }
    }
}
