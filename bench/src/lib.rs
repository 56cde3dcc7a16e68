//! Images that count their own instructions on an emulated microcontroller.
//!
//! An image reads `inputs.bin` from its host by semihosting, passes every [`Block`](block::Block)
//! through every contender, says on its standard output how many instructions each took, and writes
//! what came out to `outputs.bin`. The host runs the same contenders and compares the bits.
//!
//! `cargo xtask bench` builds and runs the images; this crate holds what image and host share, and,
//! on the microcontroller's target, the [`machine`].
#![no_std]
#![deny(unsafe_code)]

pub mod any_sections;
pub mod block;
pub mod contender;
pub mod idsp_cascade;
#[cfg(target_os = "none")]
pub mod machine;
pub mod tally;
