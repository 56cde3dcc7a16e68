//! Golden vectors that a microcontroller, emulated or on a board, checks by itself.
//!
//! Each [`Vector`] runs a part of the signal path on a generated input and compares the output with
//! the expected one, which `build.rs` has written. The expected output comes from scipy, from
//! model-gen's batch reference or from the dumps in `docs/wire-format.md`; for parts that these do
//! not cover, the portable kernels compute it on the PC. A [`Mismatch`] names the first number that
//! differs.
//!
//! ```text
//! scipy, model-gen, docs, PC ── build.rs ──> golden.rs ──┐ expected
//!                                                        ├─ equal? ──> `passed` or `FAILED`, by semihosting
//! generated input ──> part of the signal path ───────────┘ computed
//! ```
//!
//! `cargo xtask hil` builds and runs the image; this crate's test runs the same vectors on the PC.
//!
//! ```
//! use on_target::{Device, VECTORS};
//!
//! let mut device = Box::new(Device::new());
//! let vector = VECTORS.iter().find(|vector| vector.name == "frame of a code").unwrap();
//! assert_eq!((vector.check)(&mut device), Ok(()));
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(not(target_os = "none"))]
extern crate std;

mod chain;
mod filters;
mod frames;
mod kernels;
mod mismatch;
mod path;
#[cfg(not(target_os = "none"))]
pub mod results;
mod signal;

/// Expected outputs of the golden vectors, written by `build.rs`.
#[allow(clippy::unreadable_literal, reason = "generated numbers in the format of the model")]
mod golden {
    use fixed_dsp::{Cascade, Coefficient, Resampler, Section};
    use model::{CELLS, CODE, STEPS};
    use pipeline::{Code, CodeValues};

    use crate::filters::Filtered;

    include!(concat!(env!("OUT_DIR"), "/golden.rs"));
}

pub use mismatch::Mismatch;
pub use path::Device;

/// Golden vector: a check of one part of the signal path against expected outputs.
#[derive(Clone, Copy, Debug)]
pub struct Vector {
    /// Name of the part, as the image prints it.
    pub name: &'static str,
    /// Runs the part and compares its output with the expected one.
    ///
    /// # Errors
    /// Returns the first number that differs.
    pub check: fn(&mut Device) -> Result<(), Mismatch>,
}

/// All golden vectors, in the order of the signal path. A build for the STM32F446 has no vector for
/// the packed code, because its flash has no room for the packed code in addition to the network.
pub const VECTORS: &[Vector] = &[
    Vector {
        name: "filters, 512 Hz, 50 Hz mains",
        check: |_| filters::check(&golden::HZ_512_MAINS_50),
    },
    Vector {
        name: "filters, 512 Hz, 60 Hz mains",
        check: |_| filters::check(&golden::HZ_512_MAINS_60),
    },
    Vector {
        name: "filters and resampler, 500 Hz",
        check: |_| filters::check(&golden::HZ_500_FIR),
    },
    Vector {
        name: "int8 kernels, random layers",
        check: |_| mismatch::expect_equal("digest", &golden::KERNELS, &kernels::digests()),
    },
    Vector { name: "network's sum", check: |_| path::check_network_sum() },
    Vector { name: "network's codes", check: |device| path::check_windows(&mut device.encoder) },
    Vector {
        name: "samples to codes, 50 Hz mains",
        check: |device| path::check(device, pipeline::Mains::Hz50, &golden::CODES_50),
    },
    Vector {
        name: "samples to codes, 60 Hz mains",
        check: |device| path::check(device, pipeline::Mains::Hz60, &golden::CODES_60),
    },
    Vector { name: "samples to features", check: path::check_features },
    #[cfg(not(feature = "f446"))]
    Vector { name: "packed code's sum", check: |_| path::check_packed_sum() },
    #[cfg(not(feature = "f446"))]
    Vector { name: "samples to packed blocks", check: path::check_blocks },
    Vector { name: "frame of a code", check: |_| frames::check_code() },
    Vector { name: "frame of a command", check: |_| frames::check_command() },
    Vector { name: "damaged frames", check: |_| frames::check_damaged() },
];

#[cfg(test)]
mod tests {
    use std::boxed::Box;

    use super::*;

    #[test]
    fn every_vector_passes_on_the_pc_and_again_on_a_used_device() {
        let mut device = Box::new(Device::new());
        for vector in VECTORS.iter().chain(VECTORS) {
            let outcome = (vector.check)(&mut device);
            assert_eq!(outcome, Ok(()), "{}", vector.name);
        }
    }
}
