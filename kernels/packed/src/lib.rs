//! Codes blocks of transform coefficients in few bits, with a prediction and in integers only.
//!
//! A linear transform turns a block of a signal into coefficients, and a linear predictor estimates
//! the coefficients from the previous block. This crate codes the difference: it chooses the
//! magnitudes ([`quantise`]), writes and reads them ([`write_block`], [`BlockReader`]), and
//! computes the state from which both sides predict the next block ([`update_state`]). The matrices
//! of transform and predictor belong to the caller.
//!
//! ```text
//! coefficients --> - --> quantise --> magnitudes --> write_block --> bytes --> BlockReader --> magnitudes
//!                  ^                      |                                                      |
//!             prediction <-- update_state +                            prediction <-- update_state
//! ```
//!
//! The range coder of a block depends on no earlier block, so that each block can be parsed alone.
//! One set of tables serves every [`Rate`]. docs/packed.md has the format.
//!
//! ```
//! use packed::{BlockReader, Context, Header, Magnitude, Malformed, Rate, Tables};
//!
//! // All magnitudes are equally likely.
//! let starts = [[core::array::from_fn(|magnitude| 2048 * magnitude as u16); 64]; 2];
//! let costs = [[[5 * 16; 16]; 64]; 2];
//! let tables = Tables { starts: &starts, costs: &costs };
//! let rate = Rate::new(4).expect("rates are 0..=15");
//! let mut contexts = [Context::EMPTY; 4];
//! packed::prepare_contexts(&[30; 4], rate, &mut contexts);
//!
//! let residual = [500, -70, 3, -33];
//! let (mut magnitudes, mut survivors) = ([Magnitude::default(); 4], [0; 4]);
//! packed::quantise(&residual, &contexts, &tables, rate, &mut survivors, &mut magnitudes);
//! let mut bytes = [0; 20];
//! let header = Header { rate, is_reset: true };
//! let length = packed::write_block(header, rate, &magnitudes, &contexts, &tables, &mut bytes);
//!
//! let reader = BlockReader::new(&bytes[..length], rate)?;
//! assert_eq!(reader.header(), header);
//! let mut read = [Magnitude::default(); 4];
//! reader.read_magnitudes(&contexts, &tables, &mut read)?;
//! assert_eq!(read, magnitudes);
//!
//! let mut state = [0; 4];
//! packed::update_state(&read, rate, &mut state);
//! for (state, residual) in state.into_iter().zip(residual) {
//!     assert!((i32::from(state) - residual).abs() <= rate.step());
//! }
//! # Ok::<(), Malformed>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![expect(clippy::inline_always, reason = "a call costs more than the body of these functions")]

mod block;
mod context;
mod quantiser;
mod range_coder;
mod rate;
mod tables;
mod trellis;

pub use block::{BlockReader, Header, Malformed, write_block};
pub use context::{Context, Symbol, prepare as prepare_contexts, symbols};
pub use quantiser::{Magnitude, update_state};
pub use rate::{RATES, Rate};
pub use tables::{Costs, FREQUENCY_BITS, LEVELS, MAGNITUDES, Starts, Tables};
pub use trellis::{MAX_COEFFICIENTS, Survivors, quantise};

/// Number of probes, which are the last coefficients of a block in a model with weighted errors.
///
/// The rows of a weighted transform are not orthonormal, so the energy that the coefficients do not
/// represent is not the block's energy minus the coefficients' energy. Probes are orthogonal
/// directions without signal: their energy, times `2^PROBE_SHIFT`, estimates the energy that is not
/// represented.
pub const PROBES: usize = 8;

/// 2^`PROBE_SHIFT` is the expected ratio of the energy that a block's coefficients do not represent
/// to the energy of the block's probes.
pub const PROBE_SHIFT: u32 = 5;

#[cfg(test)]
extern crate std;
