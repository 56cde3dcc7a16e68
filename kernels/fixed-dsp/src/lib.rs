//! Fixed-point filters and resamplers for many channels, independent of EEG.
//!
//! Cascades of second-order IIR sections with exact rounding-error feedback, and polyphase FIR
//! resamplers. The crate is `no_std`. Samples are filtered with integers only, so the output bits
//! are the same on every machine.
//!
//! ```text
//! Coefficient --> Section --> Cascade           configuration, shared by all channels
//!                               |
//! i32 samples ----> Filter::apply (CascadeState) ----> DelayLine ----> Resampler ----> i32 samples
//!                   one state per channel              last samples    lower rate
//! ```
//!
//! A [`Cascade`] holds coefficients, a [`CascadeState`] the memory of one channel. Where the
//! coefficients are known when the program is built, [`Compiled`] generates code for them; the
//! output bits are the same. The caller chooses the fixed-point format of the samples and leaves
//! the headroom that the cascade's worst-case gain needs.
//!
//! ```
//! use fixed_dsp::{Cascade, CascadeState, Coefficient, Filter, Section};
//!
//! // y0 = x0 - 2 x1 + x2 + 1.5 y1 - 0.5625 y2: a high-pass with a double pole at 0.75.
//! let high_pass = Section::HighPass {
//!     a1: Coefficient::nearest(1.5),
//!     a2: Coefficient::nearest(-0.5625),
//! };
//! let cascade = Cascade { sections: [high_pass] };
//! let mut state = CascadeState::REST;
//! assert_eq!(cascade.apply(&mut state, 1_000), 1_000);
//! assert_eq!(cascade.apply(&mut state, 1_000), -1_000 + 1_500);
//! ```
#![no_std]
#![deny(unsafe_code)]
#![expect(
    clippy::inline_always,
    reason = "constants must reach the innermost loop to become code; see `Compiled`"
)]

#[cfg(test)]
extern crate std;

mod accumulator;
mod band_power;
mod cascade;
mod coefficient;
mod filter;
mod resampler;
mod section;

pub use band_power::{BAND_SECTIONS, BandPass, BandPower, LEVEL_OF_ONE, LEVELS_PER_OCTAVE, level};
pub use cascade::{Cascade, CascadeState, MAX_SECTIONS};
pub use coefficient::Coefficient;
pub use filter::{BLOCK, Compiled, Design, Filter};
pub use resampler::{DelayLine, Position, Resampler};
pub use section::Section;
