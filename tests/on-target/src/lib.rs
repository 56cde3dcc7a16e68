//! Golden vectors that a microcontroller checks itself, emulated or on a board.
//!
//! Each [`Vector`] runs a part of the signal path on inputs that everybody can make and compares what
//! comes out with what `build.rs` has laid down: scipy's outputs, model-gen's batch codes, the dumps of
//! `docs/wire-format.md`, and for the rest the bits that the PC makes with the plain twins of the
//! kernels. The first number that differs is named.
//!
//! `cargo xtask hil` builds and runs the image; this crate's own test runs the same vectors on the PC.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod chain;
mod device;
mod filters;
mod frames;
mod golden;
mod kernels;
mod mismatch;
mod network;
mod path;
mod signal;

pub use device::Device;
pub use mismatch::Mismatch;

/// A part of the signal path, and what it must give.
#[derive(Clone, Copy, Debug)]
pub struct Vector {
    /// The part.
    pub name: &'static str,
    /// Runs it.
    ///
    /// # Errors
    /// The first number that is not the expected one.
    pub check: fn(&mut Device) -> Result<(), Mismatch>,
}

/// All of them, along the signal path.
pub const VECTORS: [Vector; 11] = [
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
        check: |_| mismatch::same("sum", &golden::KERNELS, &kernels::results()),
    },
    Vector {
        name: "network's sum",
        check: |_| network::check_sum(),
    },
    Vector {
        name: "network's codes",
        check: |device| network::check_codes(&mut device.encoder),
    },
    Vector {
        name: "samples to codes, 50 Hz mains",
        check: |device| path::check(device, pipeline::Mains::Hz50, &golden::CODES_50),
    },
    Vector {
        name: "samples to codes, 60 Hz mains",
        check: |device| path::check(device, pipeline::Mains::Hz60, &golden::CODES_60),
    },
    Vector {
        name: "frame of a code",
        check: |_| frames::check_code(),
    },
    Vector {
        name: "frame of a command",
        check: |_| frames::check_command(),
    },
    Vector {
        name: "damaged frames",
        check: |_| frames::check_damaged(),
    },
];

#[cfg(test)]
mod tests {
    use std::boxed::Box;

    use super::*;

    #[test]
    fn every_vector_holds_on_the_pc_and_again_on_a_device_that_is_not_new() {
        let mut device = Box::new(Device::new());
        for vector in VECTORS.iter().chain(&VECTORS) {
            let outcome = (vector.check)(&mut device);
            assert_eq!(outcome, Ok(()), "{}", vector.name);
        }
    }
}
