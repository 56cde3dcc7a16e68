//! Benchmarks of filters and encoder: images that count their own instructions on an emulated
//! microcontroller, and the program `report` that runs them.
//!
//! An image reads `inputs.bin` through semihosting, runs the functions under test on these inputs,
//! prints the number of their instructions and writes their outputs to `outputs.bin`. On the PC,
//! `report` runs the same functions on the same inputs, compares the outputs bit for bit, and
//! checks all figures against `tests/bench/limits.toml`.
//!
//! ```text
//!            inputs.bin              counts as TOML ─────┐
//! report ──────────────> image, QEMU ────────────────────┤
//!   │                                outputs.bin ──────┐ │
//!   └── same inputs ──> same code on the PC ── equal? ─┴─┴─> table or JSON, limits.toml
//! ```
//!
//! The image `filters` passes every [`Block`](block::Block) through every
//! [`Contender`](contenders::Contender); `encoder` takes one [`Plane`](pipeline::Plane) per time
//! step and counts each time step of a [`hop`]; `lossless` compresses the [blocks of
//! samples](compression); `substitution` replaces the bad electrodes in the [steps](substituted) of
//! each input.
//!
//! ```
//! use bench::{contenders::with_contenders, block::SILENCE};
//!
//! // Our filters keep silence silent: their rounding has no offset.
//! with_contenders(|contenders| {
//!     let blocks = &mut *contenders[0];
//!     blocks.load(&SILENCE);
//!     blocks.run();
//!     assert_eq!(blocks.output(), SILENCE);
//! });
//! ```
#![cfg_attr(target_os = "none", no_std)]
#![deny(unsafe_code)]

pub mod any_sections;
pub mod block;
pub mod compression;
pub mod contenders;
pub mod hop;
pub mod idsp_cascade;
pub mod kernel;
#[cfg(target_os = "none")]
pub mod machine;
mod random;
#[cfg(not(target_os = "none"))]
pub mod report;
pub mod substituted;
pub mod tally;

/// Turns a program into an image: adds a panic handler, and for a PC a `main` that prints where the
/// program must run.
#[macro_export]
macro_rules! image {
    ($benchmark:literal) => {
        #[cfg(not(target_os = "none"))]
        fn main() {
            eprintln!(concat!(
                "this image runs on the emulated microcontroller: `cargo xtask bench ",
                $benchmark,
                "`"
            ));
        }

        #[cfg(target_os = "none")]
        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
            $crate::machine::panicked(info)
        }
    };
}
