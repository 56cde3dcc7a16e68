//! Runs the application's image on both emulated microcontrollers and compares what it sends with
//! host-sim.
//!
//! Each module of `tests/it/` is one scenario: it prepares the files that the image reads, runs the
//! image in virtual time, and records and checks the results. This library holds what the scenarios
//! share.
//!
//! ```text
//! Input ─┬─ samples.i32 ──> board-qemu in QEMU ── UART ──> Boot ─┬─ assertions
//!        └─ host-sim's virtual board ── Outbox ─────────> Boot ─┘
//! ```
//!
//! ```
//! use emulated::frames::{Boot, simulated};
//! use emulated::input::Input;
//! use link::Streams;
//!
//! let input = Input::new(3);
//! let boot = Boot::only(&simulated(Streams::CODES, &input.samples));
//! assert_eq!(boot.codes().len(), 3);
//! ```
#![forbid(unsafe_code)]

pub mod board;
pub mod compare;
pub mod frames;
pub mod input;
pub mod script;
pub mod stages;
