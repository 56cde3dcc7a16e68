//! Trains the packed model: transform, prediction, probabilities and corrections.
//!
//! ```text
//! tracks --> Blocks --> Transform (float) --> PackedModel --coded--> levels, frequencies --> corrections
//!                        KLT of what a         integers, with         four rounds             ridge
//!                        predictor leaves      proven ranges
//! ```

mod blocks;
mod coded;
mod corrections;
mod evaluation;
mod integers;
mod probabilities;
mod ridge;
mod session;
mod transform;

pub use blocks::Blocks;
pub use evaluation::RateFigures;
pub use session::{PackedOptions, train};
