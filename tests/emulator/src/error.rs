//! Errors of building and running an image.

use std::io;
use std::path::{Path, PathBuf};

/// Reason why an image was not built or did not run to its end. Each message states what failed,
/// why, and what to do next.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// `qemu-system-arm` is not installed: no folder of PATH contains it.
    #[error(
        "QEMU is missing: `qemu-system-arm` does not start\n  next: `sudo apt-get install qemu-system-arm`"
    )]
    QemuMissing,
    /// The standard library for the microcontroller is not installed.
    #[error(
        "the standard library for {target} is missing: `rustc --print=target-libdir` names no folder\n  \
         next: `rustup target add {target}`",
        target = crate::qemu::TARGET
    )]
    TargetMissing,
    /// Cargo failed. Its own messages went to the standard error.
    #[error("`{command}` failed: {why}\n  next: read the compiler's message above")]
    Build {
        /// Command line of cargo, as a user would type it in a shell.
        command: String,
        /// Exit status of cargo, or what its messages lacked.
        why: String,
    },
    /// The emulator did not start or ended with an error, or the image ended with an error or
    /// printed nothing for too long.
    #[error("the image failed: {why}; it printed: {output}\n  next: run it by hand: `{command}`")]
    Failed {
        /// Exit status of the emulator, the time for which the image printed nothing, or the
        /// operating system's reason.
        why: String,
        /// All lines that the image printed, separated by slashes.
        output: String,
        /// Command line that repeats the run when typed in a shell.
        command: String,
    },
    /// A file that belongs to the run cannot be created, read or written.
    #[error("cannot use the file {}: {error}\n  next: is its folder writable, and the disk not full?", path.display())]
    File {
        /// Path of the file, or of the folder that should contain it.
        path: PathBuf,
        /// Reason that the operating system states.
        error: io::Error,
    },
}

impl EmulatorError {
    /// Returns whether the user must install something: QEMU or the target's standard library.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::QemuMissing | Self::TargetMissing)
    }

    /// Returns a function for `map_err` that adds `path` to a file system error.
    pub fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        |error| Self::File { path, error }
    }
}
