//! Images that count their own instructions on an emulated microcontroller.
//!
//! An image reads `inputs.bin` from its host by semihosting, passes it on to what is counted, says on
//! its standard output how many instructions that took, and writes what came out to `outputs.bin`.
//! The host runs the same and compares the bits.
//!
//! `filters` passes every [`Block`](block::Block) through every contender; `encoder` takes a
//! [`Plane`](pipeline::Plane) per step and counts each step of a [`hop`].
//!
//! `cargo xtask bench` builds and runs the images; this crate holds what image and host share, and,
//! on the microcontroller's target, the [`machine`].
#![no_std]
#![deny(unsafe_code)]

pub mod any_network;
pub mod any_sections;
pub mod block;
pub mod contender;
pub mod hop;
pub mod host;
pub mod idsp_cascade;
pub mod kernel;
#[cfg(target_os = "none")]
pub mod machine;
mod random;
pub mod stress;
pub mod tally;
