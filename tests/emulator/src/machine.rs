//! The emulated microcontrollers.

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
