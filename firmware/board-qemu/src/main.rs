//! The application on an emulated microcontroller: QEMU's mps2-an386 (Cortex-M4F) or mps2-an500
//! (Cortex-M7).
//!
//! The image itself simulates the converter. Everything else works as on a board: Thumb code,
//! interrupts, three executors and a UART. The samples come from the file `sample_source::SAMPLES`
//! in QEMU's working directory, and the emulation ends after the last sample of the file. Without
//! the file, the samples are synthetic and endless. Under `-icount`, repeated emulations produce
//! the same bytes.
//!
//! Arguments:
//!
//! | Argument | Effect |
//! | --- | --- |
//! | `start` | streams codes without a command from the host |
//! | `start-all` | starts, without a command from the host, all streams except packed blocks |
//! | `start-packed` | starts, without a command from the host, all streams that need no network |
//! | `commands` | delivers the commands in the file `commands::COMMANDS` at their times |
//! | `trigger` | applies the edges in the file `trigger::EDGES` to the trigger input |
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![deny(unsafe_code)]

/// On a PC, prints how to run the image.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image runs on an emulated microcontroller: `cargo xtask qemu`");
}

#[cfg(target_os = "none")]
mod application;
#[cfg(target_os = "none")]
mod commands;
#[cfg(target_os = "none")]
mod drdy;
#[cfg(target_os = "none")]
mod failure;
#[cfg(target_os = "none")]
mod interrupts;
#[cfg(target_os = "none")]
mod registers;
#[cfg(target_os = "none")]
mod sample_source;
#[cfg(target_os = "none")]
mod semihosting;
#[cfg(target_os = "none")]
mod time_driver;
#[cfg(target_os = "none")]
mod trigger;
#[cfg(target_os = "none")]
mod uart;
