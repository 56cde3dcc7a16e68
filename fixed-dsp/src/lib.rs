//! Fixed-point filter sections, cascades and decimators: signals, nothing about EEG.
//!
//! A [`Cascade`] is configuration (coefficients), a [`CascadeState`] is what one channel remembers;
//! the same cascade runs over any number of channels. Samples are `i32`; the caller chooses the
//! format and owes the head room that the cascade's worst-case gain needs.
//!
//! ```
//! use fixed_dsp::{Cascade, CascadeState, Coefficient, Section, Shape};
//!
//! // y = x0 - 2 x1 + x2 + 1.5 y1 - 0.5625 y2: a high-pass with a double pole at 0.75.
//! let high_pass = Section {
//!     shape: Shape::HighPass,
//!     gain: Coefficient::ONE,
//!     first: Coefficient::nearest(1.5),
//!     second: Coefficient::nearest(-0.5625),
//! };
//! let cascade = Cascade { sections: [high_pass] };
//! let mut state = CascadeState::default();
//! assert_eq!(cascade.step(&mut state, 1_000), 1_000);
//! assert_eq!(cascade.step(&mut state, 1_000), -1_000 + 1_500);
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod cascade;
mod coefficient;
mod decimator;
mod section;

pub use cascade::{Cascade, CascadeState};
pub use coefficient::Coefficient;
pub use decimator::Decimator;
pub use section::{Section, SectionState, Shape};
