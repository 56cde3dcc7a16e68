//! The application on an emulated microcontroller: QEMU's mps2-an386 (Cortex-M4F) or mps2-an500
//! (Cortex-M7).
//!
//! Only the converter is simulated by the image. Thumb code, interrupts, three executors and a UART run as on
//! a board. The samples come from the file [`sample_source::SAMPLES`] in QEMU's working directory, and the
//! emulation ends with that file. Without the file they are synthetic and endless. Under `-icount` a run
//! repeats byte for byte.
//!
//! Arguments:
//!
//! | Argument | Effect |
//! | --- | --- |
//! | `start` | streams codes without a command from the host |
//! | `start-all` | starts all streams without a command from the host |
//! | `hang`, `panic`, `fault` | a task fails in this way 1 s into the first run; the second run reports it |
//! | `commands` | plays the commands in [`commands::COMMANDS`] at their times |
//! | `trigger` | plays the edges in [`trigger::EDGES`] at the trigger input |
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![deny(unsafe_code)]

/// Explains on a PC how the image is run.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image runs on an emulated microcontroller: `cargo xtask qemu`");
}

#[cfg(target_os = "none")]
mod application;
#[cfg(target_os = "none")]
mod arguments;
#[cfg(target_os = "none")]
mod commands;
#[cfg(target_os = "none")]
mod drdy;
#[cfg(target_os = "none")]
mod eeg;
#[cfg(target_os = "none")]
mod failure;
#[cfg(target_os = "none")]
mod host_file;
#[cfg(target_os = "none")]
mod interrupts;
#[cfg(target_os = "none")]
mod registers;
#[cfg(target_os = "none")]
mod sample_source;
#[cfg(target_os = "none")]
mod shared;
#[cfg(target_os = "none")]
mod time_driver;
#[cfg(target_os = "none")]
mod trigger;
#[cfg(target_os = "none")]
mod uart;
