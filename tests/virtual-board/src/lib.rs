//! Emulated boards that run the unmodified firmware images.
//!
//! [`VirtualBoard`] loads the ELF file that `cargo flash` writes, and runs it in virtual time on an
//! emulated microcontroller (the crate `rigless`). Simulated ADS1299 converters are connected to
//! the SPI and pins of the microcontroller, and a host to its UART or USB. A test powers the board
//! on, sends commands, runs the board for a while, and reads the frames that the board has sent.
//!
//! ```text
//! test, bridge <-- frames, commands --> Port <--> UART or USB
//!                                                     |
//!                               firmware image on an emulated Cortex-M
//!                                                     |
//! ads1299::simulation <--> chain: SPI, selects, START, RESET, DRDY; trigger pin
//! ```
//!
//! ```no_run
//! use std::path::Path;
//!
//! use virtual_board::{Cable, Image, Kind, Model, Setup, VirtualBoard};
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let image = Image::read(Path::new("board-h743"), Model::H743)?;
//!     let setup = Setup {
//!         cable: Cable::Usb,
//!         ..Setup::default()
//!     };
//!     let mut board = VirtualBoard::power_on(Model::H743, &image, &setup);
//!     board.run_until("the first Hello", 1_000_000, |frames| !frames.is_empty())?;
//!     let first = &board.inbox().frames()[0];
//!     assert!(matches!(first.kind, Kind::Hello { .. }));
//!     assert!(board.findings()?.unmapped.is_empty());
//!     Ok(())
//! }
//! ```
//!
//! [`Findings`] lists what the emulator detected: accesses to unmapped addresses, registers without
//! a model, violations of the reference manual.
//!
//! Not modelled: cycle counts, the effects of caches and of the MPU, analogue settling, electrical
//! levels. Every instruction takes the same time ([`Facts::instructions_per_second`], unless
//! [`Setup::instructions_per_second`] sets another).
#![deny(unsafe_code)]

mod board;
mod chain;
mod chip;
mod converters;
mod core_bus;
mod findings;
mod frames;
mod image;
mod injection;
mod inspection;
pub mod live;
mod machine;
mod model;
mod port;
mod processor;
pub mod usb;

pub use board::{Cable, Setup};
pub use chain::{electrode_count, electrode_ohms};
pub use converters::Converters;
pub use findings::{BoardError, Findings};
pub use frames::{Frame, Inbox, Kind, ReceivedCode};
pub use image::{Image, ImageError, elf};
pub use injection::Injection;
pub use live::TcpPort;
pub use machine::VirtualBoard;
pub use model::{Facts, Model};
pub use port::Port;
