//! The packed model: a predictive transform code of few bits, beside the network.

mod description;
mod file;
mod file_names;
mod integer_matrix;
mod model;
mod ranges;
mod smoother;
#[cfg(test)]
mod tests;

pub use description::{PackedDescription, PackedFigures, PackedTraining};
pub(crate) use file::PackedFiles;
pub(crate) use file_names::{DESCRIPTION as PACKED_DESCRIPTION, TENSORS as PACKED_TENSORS};
pub use integer_matrix::IntegerMatrix;
pub use model::{PackedModel, rounded_state};
pub use ranges::{INPUTS_PER_ROUND, LARGEST_STATE, SUM_LIMIT, slice_ends};
pub use smoother::Smoother;
