//! Launches microcontroller images in QEMU.
//!
//! [`Image::build`] compiles an image for one of the two emulated [`MACHINES`]. [`Qemu`] assembles
//! the command line and runs the image to its end: it passes on each line that the image prints,
//! and fails when the image prints nothing for too long. The UART is a file, a pair of named pipes
//! or a TCP port.
//!
//! ```text
//! Image::build ── cargo ──> copy in target/emulator/ ──> Qemu ──> qemu-system-arm
//!                                  semihosting: printed lines ─────────┤
//!                                  files or named pipes of the folder ─┤
//!                                  UART: file, named pipes or TCP ─────┘
//! ```
//!
//! ```
//! use emulator::{Image, MACHINES, Qemu, Uart};
//! use std::path::Path;
//!
//! let [cortex_m4f, _cortex_m7] = MACHINES;
//! let image = Image::at("board-qemu.elf");
//! let mut qemu = Qemu::new(&image, cortex_m4f, Path::new("."), &["board-qemu", "start"]);
//! qemu.instruction_time(4).uart(Uart::File("uart"));
//! assert_eq!(qemu.into_command().get_program(), "qemu-system-arm");
//! ```
#![forbid(unsafe_code)]

pub mod error;
pub mod figures;
pub mod image;
pub mod installed;
pub mod pipes;
pub mod qemu;
pub mod skip;

pub use error::EmulatorError;
pub use image::{Image, OtherModel};
pub use qemu::{MACHINES, Machine, Qemu, Uart};
