//! The packed model: a predictive transform code of few bits, beside the network or alone.

mod description;
mod integer_matrix;
mod model;

pub use description::{PackedDescription, PackedFigures, PackedTraining};
pub use integer_matrix::IntegerMatrix;
pub use model::{Correction, PackedModel, rounded_state};
