//! The application on an emulated microcontroller: QEMU's mps2-an386 (Cortex-M4F) or mps2-an500
//! (Cortex-M7).
//!
//! Everything but the converter is real: thumb code, interrupts, three executors, a UART. The samples
//! come from a file of the host, [`recording::SAMPLES`] in QEMU's working folder, or are made up where
//! there is none. The emulation ends with the file. Under `-icount` a run repeats itself byte for byte.
//!
//! Arguments: `start` starts the codes without a host, `start-all` everything that there is; `hang`,
//! `panic` and `fault` let a task do so after a second of the first run, to see what the second says of
//! it; `commands` takes commands from [`commands::COMMANDS`] and `trigger` edges of the trigger input
//! from [`trigger::EDGES`], each at its time.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![deny(unsafe_code)]

/// On a PC there is nothing to run.
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
mod recording;
#[cfg(target_os = "none")]
mod registers;
#[cfg(target_os = "none")]
mod time_driver;
#[cfg(target_os = "none")]
mod trigger;
#[cfg(target_os = "none")]
mod uart;
