//! Int8 neural-network kernels for Cortex-M4 and M7, independent of any particular network.
//!
//! A three-dimensional convolution over (time, row, column) is computed one time step ("plane") at
//! a time. In a stream, each plane is thus computed once, and little work is left after the last
//! plane of a window. The kernels allocate nothing and use no floating point.
//!
//! ```text
//! i8 plane --> InputConv --> 0..=255 plane --> Winograd (or Direct), max-pool --> i32 sums
//!                                                                                   |
//!     i32 accumulators <-- Linear <-- 0..=255 plane <-- bias, requantise, saturate_u8
//! ```
//!
//! [`Direct`] replaces [`Winograd`] if the pool has another shape than Winograd supports, or if
//! Winograd's transformed values could overflow.
//!
//! Conventions of all kernels:
//! * Planes are flat slices of [`Pair`]s. A pair holds the values of two channels in one word of 2
//!   x 16 bits, the operand of SMLAD. A plane that one convolution passes to the next has the order
//!   `[pair of channels][row][column]`.
//! * Weights are 8 bits, -127..=127, and packed or transformed by the kernel that reads them.
//!   Accumulators and biases are `i32`.
//! * Accumulators wrap. The code that builds the network must prove from the weights that no
//!   accumulator overflows; model-gen does so at build time.
//! * Requantisation multiplies by a Q0.32 factor, rounds once, half up ([`requantise`]), and
//!   saturates.
//! * No branch depends on data, so a kernel takes the same number of instructions for any input.
//!
//! On a Cortex-M4 or M7 the inner loops are assembler (`dot/cortex_m/`, `linear/cortex_m.rs`,
//! `winograd/cortex_m.rs`), each with a portable equivalent. `cargo xtask bench encoder` checks
//! that both produce the same codes. On a PC, the same kernels are compiled both for AVX2 and for
//! any processor, and `octet.rs` selects one at run time.
//!
//! ```
//! use int8_nn::{Linear, Pair, requantise, saturate_i8};
//!
//! // A layer from 16 inputs to 4 outputs: output j sums the inputs, times j + 1.
//! let (pairs, outputs) = (8, 4);
//! let weights: Vec<i8> = (0..16).flat_map(|_| [1, 2, 3, 4]).collect();
//! let mut packed = [Pair::ZERO; 8 * 4 / 2];
//! Linear::pack_weights(pairs, outputs, &weights, &mut packed);
//! let layer = Linear { inputs: pairs, outputs, weights: &packed };
//!
//! let mut sums = [100, 0, 0, 0]; // the biases
//! layer.accumulate(&[Pair::new([10, 10]); 8], &mut sums);
//! assert_eq!(sums, [260, 320, 480, 640]);
//! // Times 0.25, saturated to 8 bits.
//! assert_eq!(sums.map(|sum| saturate_i8(requantise(sum, 1 << 30))), [65, 80, 120, 127]);
//! ```
#![no_std]
#![deny(unsafe_code)]
#![expect(clippy::inline_always, reason = "a call costs more than the body of these functions")]

#[cfg(test)]
extern crate std;

mod direct;
mod dot;
mod input_conv;
mod linear;
mod octet;
mod pair;
mod plane;
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
