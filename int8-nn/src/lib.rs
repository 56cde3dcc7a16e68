//! Int8 neural-network kernels for Cortex-M4 and M7, one plane at a time: nothing about our network.
//!
//! A three-dimensional convolution over (time, row, column) is computed one time step ("plane") at
//! a time, so that a stream needs each plane once and a window's last plane leaves little to do.
//!
//! ```text
//! plane --InputConv--> plane --Winograd (conv, pool)--> sums --unscaled, requantise--> plane --Linear--> sums
//! i8                   0..=255                          i32                            0..=255           i32
//! ```
//!
//! [`Direct`] stands in for [`Winograd`] where the pool or the ranges ask for it.
//!
//! Conventions shared by all kernels:
//! * planes are flat slices of [`Pair`]s, two channels in a word of 16 bits each, because that is what
//!   SMLAD multiplies; between the convolutions `[pair of channels][row][column]`;
//! * weights have 8 bits, -127..=127, and are packed or transformed by the kernel that reads them;
//!   accumulators and biases are `i32`;
//! * accumulators wrap; that they cannot is proven from the weights by whoever builds the network
//!   (model-gen does, at build time);
//! * requantisation is a multiplication by a Q0.32 number with one rounding, half up
//!   ([`requantise`]), then saturation;
//! * nothing branches on data, so a kernel takes the same number of instructions for any input.
//!
//! On a Cortex-M4 or M7 the inner loops are assembler (`dot/cortex_m/`, `linear/cortex_m.rs`,
//! `winograd/cortex_m.rs`) with plain twins beside them; integer only. `cargo xtask bench encoder`
//! holds both to the same codes.
#![no_std]
#![deny(unsafe_code)]
#![expect(
    clippy::inline_always,
    reason = "a call costs more than what these functions do"
)]

#[cfg(test)]
extern crate std;

mod direct;
mod dot;
mod input_conv;
mod linear;
mod pair;
mod plane;
mod quad;
mod requantise;
mod ring;
mod winograd;

pub use direct::Direct;
pub use input_conv::InputConv;
pub use linear::Linear;
pub use pair::Pair;
pub use plane::PlaneShape;
pub use requantise::{requantise, requantise_sum, saturate_i8, saturate_u8};
pub use ring::PlaneRing;
pub use winograd::Winograd;
