//! Checks whether the programs that build and emulate an image are installed.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::error::EmulatorError;
use crate::qemu::{QEMU, TARGET};
use crate::skip::skip_unless_required;

/// Returns whether QEMU and the standard library for [`TARGET`] are installed. If not, reports the
/// test named `test` as skipped.
///
/// # Panics
/// When QEMU or the library is missing and `CORTICODE_REQUIRE_ROS=1`.
pub fn available(test: &str) -> bool {
    check().map_err(|error| skip_unless_required(test, error)).is_ok()
}

/// Checks that QEMU starts and that the compiler has the standard library for [`TARGET`].
///
/// # Errors
/// [`EmulatorError::QemuMissing`] or [`EmulatorError::TargetMissing`].
pub fn check() -> Result<(), EmulatorError> {
    let mut qemu = Command::new(QEMU);
    qemu.arg("--version").stdout(Stdio::null());
    if !qemu.status().is_ok_and(|status| status.success()) {
        return Err(EmulatorError::QemuMissing);
    }
    check_target()
}

/// Checks that the compiler has the standard library for [`TARGET`].
///
/// # Errors
/// [`EmulatorError::TargetMissing`].
pub fn check_target() -> Result<(), EmulatorError> {
    let mut rustc = Command::new("rustc");
    rustc.args(["--print=target-libdir", "--target", TARGET]);
    let folder = rustc.output().map(|output| output.stdout);
    let folder = folder.unwrap_or_default();
    // Without the target, rustc prints a folder that does not exist, or nothing.
    let exists = Path::new(String::from_utf8_lossy(&folder).trim()).is_dir();
    exists.then_some(()).ok_or(EmulatorError::TargetMissing)
}
