//! The NUCLEO boards on emulated microcontrollers: runs the very images that are flashed.
//!
//! ```text
//! host (test, bridge) <--> Port <--> UART or USB of the chip
//!                                         |
//!                                  image that is flashed, on an emulated core (rigless)
//!                                         |
//! simulated ADS1299 chain <--> Wires <--> SPI and pins of the chip <-- trigger
//! ```
//!
//! [`VirtualBoard`] runs an image in virtual time, in steps that its user asks for, so that a test is a
//! plain sequence: power on, run, send a command, run, look at what came. The converters are
//! `ads1299::simulation`, the same that host-sim drives. [`Findings`] has what the emulator noticed:
//! addresses that nothing answers, registers that no model implements, breaches of the reference manual.
//!
//! What it does not show: true cycles, caches and MPU attributes in effect, analogue settling, electrical
//! levels. Instructions take a fixed time ([`Model::instructions_per_second`]).
#![deny(unsafe_code)]

pub mod allowed;
mod board;
mod chain;
mod chip;
mod core_bus;
mod diagnosis;
pub mod eeg;
mod findings;
mod frames;
mod image;
mod injection;
pub mod live;
mod loader_stub;
mod look;
mod machine;
mod model;
mod port;
mod processor;
mod serial;
mod setup;
mod tcp;
pub mod usb;

pub use diagnosis::{Diagnosis, Trouble};
pub use findings::Findings;
pub use frames::{Frame, Inbox, Kind};
pub use image::{Image, ImageError};
pub use injection::Injection;
pub use machine::VirtualBoard;
pub use model::Model;
pub use port::Port;
pub use setup::{Cable, Setup};
pub use tcp::TcpPort;
