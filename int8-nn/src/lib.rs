//! Int8 neural-network kernels, one plane at a time: nothing about our network.
//!
//! A three-dimensional convolution over (time, row, column) is computed one time step ("plane") at
//! a time, so that a stream needs each plane once and a window's last plane leaves little to do.
//!
//! Conventions shared by all kernels:
//! * planes are channel-last, `[row][column][channel]`, as flat slices;
//! * activations are `i8` or `u8`, weights `i8`, accumulators and biases `i32`;
//! * accumulators wrap; that they cannot is proven from the weights by whoever builds the network
//!   (model-gen does, at build time);
//! * requantisation is a multiplication by a Q0.32 number with one rounding, half up
//!   ([`requantise`]), then saturation.
//!
//! Portable Rust throughout; integer only, so every platform gives the same bytes.
#![no_std]
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

mod conv3d;
mod dot;
mod input_conv;
mod linear;
mod max_pool;
mod pair;
mod plane;
mod requantise;
mod ring;
mod winograd;

pub use conv3d::Conv3d;
pub use input_conv::InputConv;
pub use linear::Linear;
pub use max_pool::{max_pool, requantise_plane};
pub use pair::Pair;
pub use plane::PlaneShape;
pub use requantise::{requantise, requantise_sum, saturate_i8, saturate_u8};
pub use ring::PlaneRing;
pub use winograd::{Winograd, unscaled};
