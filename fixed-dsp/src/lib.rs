//! Fixed-point filters and resamplers: signals, nothing about EEG.
//!
//! ```text
//! Section ..in series..> Cascade ..per channel..> Filter --- DelayLine ---Resampler--->
//! ```
//!
//! A [`Cascade`] is configuration (coefficients), a [`CascadeState`] is what one channel remembers;
//! the same cascade runs over any number of channels. Where the coefficients are known when the
//! program is built, [`Compiled`] makes code for them; the bits are the same. Samples are `i32`; the
//! caller chooses the format and owes the head room that the cascade's worst-case gain needs.
//!
//! ```
//! use fixed_dsp::{Cascade, CascadeState, Coefficient, Filter, Section};
//!
//! // y = x0 - 2 x1 + x2 + 1.5 y1 - 0.5625 y2: a high-pass with a double pole at 0.75.
//! let high_pass = Section::HighPass {
//!     first: Coefficient::nearest(1.5),
//!     second: Coefficient::nearest(-0.5625),
//! };
//! let cascade = Cascade { sections: [high_pass] };
//! let mut state = CascadeState::default();
//! assert_eq!(cascade.step(&mut state, 1_000), 1_000);
//! assert_eq!(cascade.step(&mut state, 1_000), -1_000 + 1_500);
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
mod cascade;
mod coefficient;
mod delay_line;
mod filter;
mod resampler;
mod section;

pub use cascade::{Cascade, CascadeState, LONGEST};
pub use coefficient::Coefficient;
pub use delay_line::DelayLine;
pub use filter::{BLOCK, Compiled, Design, Filter};
pub use resampler::{Position, Resampler};
pub use section::{Section, SectionState};
