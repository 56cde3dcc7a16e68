//! Reasons why an image was not built, did not run or ended with an error.

use std::io;
use std::path::{Path, PathBuf};

/// Reason why an image was not built or did not run to its end. Each message states what failed,
/// why, and what to do next.
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
        target = crate::qemu::TARGET
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
    /// The emulator did not start, the emulator or its image ended with an error, or the image
    /// printed nothing for too long.
    #[error("the image failed: {why}; it printed: {output}\n  next: run it by hand: `{command}`")]
    Failed {
        /// Exit status of the emulator, duration of the silence, or the reason of the operating
        /// system.
        why: String,
        /// All printed lines, separated by slashes.
        output: String,
        /// Command line that repeats the run in a shell.
        command: String,
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
    /// Returns whether QEMU or the target is missing, which the user must install.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::QemuMissing | Self::TargetMissing)
    }

    /// Returns a function for `map_err` that adds `path` to an error of the file system.
    pub fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        |error| Self::File { path, error }
    }
}
