//! Fits packed models, and linear codes, to filtered recordings, and measures their error.
//!
//! ```text
//! recording --> Track --> bad electrodes interpolated
//!                              |
//!            Blocks --> Transform --> PackedModel --coded--> levels, frequencies --> Smoother
//!                       KLT of a      integers of            four rounds             ridge
//!                       residual      proven ranges
//! ```
//!
//! `trainer` fits models to folders of recordings, and `corticode-bridge calibrate` fits them to
//! the signal that a device has just sent. `features` are the band powers that a device computes
//! for a classifier.
#![forbid(unsafe_code)]
#![expect(
    clippy::cast_precision_loss,
    reason = "counts of values are far below 2^53, those that become f32 below 2^24"
)]

pub mod bad_electrodes;
pub mod band_pass;
pub mod directions;
pub mod features;
pub mod in_parallel;
pub mod innovation;

mod coded;
mod error;
mod evaluation;
mod fit;
mod good_signal;
mod integers;
mod personal_code;
mod personal_model;
mod probabilities;
mod ridge;
mod track;
mod transform;
mod weight;

pub use error::FitError;
pub use evaluation::{RateFigures, evaluate};
pub use fit::{coefficients, fit, without_prediction};
pub use good_signal::GoodSignal;
pub use personal_code::{MIN_RANGE, PersonalCode};
pub use personal_model::{PersonalModel, error_at};
pub use track::{Track, settling_steps};
pub use weight::{Metric, weight_for};
