//! Trains the packed model: transform, prediction, probabilities and smoother.
//!
//! ```text
//! tracks --> Blocks --> Transform (float) --> PackedModel --coded--> levels, frequencies --> Smoother
//!                       KLT of what a         integers of            four rounds             ridge
//!                       predictor leaves      proven ranges
//! ```

mod alone;
mod blocks;
mod coded;
mod evaluation;
mod fit;
mod integers;
mod probabilities;
mod ridge;
mod scale;
mod session;
mod smoother;
mod transform;
mod unpredicted;

pub use alone::{AloneOptions, train_alone};
pub(crate) use evaluation::evaluate;
pub use evaluation::{RateFigures, RateTable};
pub use fit::{FitOptions, PackedTrained};
pub use session::{PackedOptions, compare, train};
