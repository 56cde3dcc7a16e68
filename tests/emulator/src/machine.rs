//! The emulated microcontrollers, and the programs that a machine needs to emulate them.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::error::EmulatorError;

/// Target triple of the images: Cortex-M4F and M7 with a single-precision FPU.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Name of the emulator's program, and of the Debian package that contains it.
pub const QEMU: &str = "qemu-system-arm";

/// A board that QEMU emulates.
#[derive(Debug, Clone, Copy)]
pub struct Machine {
    /// QEMU's name of the board, for `-machine`.
    pub name: &'static str,
    /// The board's processor.
    pub core: &'static str,
    /// Arguments of cargo that select the kernels for this processor.
    pub features: &'static [&'static str],
}

/// The smaller and the larger processor that the firmware supports.
pub const MACHINES: [Machine; 2] = [
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

/// Checks that QEMU starts and that the compiler has the standard library of [`TARGET`].
///
/// # Errors
/// [`EmulatorError::QemuMissing`] or [`EmulatorError::TargetMissing`].
pub fn check_installed() -> Result<(), EmulatorError> {
    let mut qemu = Command::new(QEMU);
    qemu.arg("--version").stdout(Stdio::null());
    if !qemu.status().is_ok_and(|status| status.success()) {
        return Err(EmulatorError::QemuMissing);
    }
    check_target()
}

/// Checks that the compiler has the standard library of [`TARGET`].
///
/// # Errors
/// [`EmulatorError::TargetMissing`].
pub fn check_target() -> Result<(), EmulatorError> {
    let mut library = Command::new("rustc");
    library.args(["--print=target-libdir", "--target", TARGET]);
    let folder = library.output().ok();
    let folder = folder.filter(|output| output.status.success());
    let exists = folder.is_some_and(|output| {
        let path = String::from_utf8_lossy(&output.stdout);
        Path::new(path.trim()).is_dir()
    });
    if exists {
        Ok(())
    } else {
        Err(EmulatorError::TargetMissing)
    }
}
