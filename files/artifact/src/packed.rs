//! The packed model: the integers of a predictive transform code with few bits.

mod file;
mod model;
mod ranges;
#[cfg(test)]
mod tests;

pub(crate) use file::{DESCRIPTION as PACKED_DESCRIPTION, TENSORS as PACKED_TENSORS};
pub use model::{
    ErrorWeight, IntegerMatrix, PackedDescription, PackedFigures, PackedModel, PackedTraining,
    Smoother, rounded_state,
};
pub(crate) use ranges::check as check_packed;
pub use ranges::{INPUTS_PER_ROUND, LARGEST_STATE, SUM_LIMIT, slice_ends};
