//! The commands sent to the device, and the identity that it reports.

mod clock_query;
pub(crate) mod commands;
pub(crate) mod identity;
pub(crate) mod pending;
mod refused_start;
mod wanted_rate;
mod wanted_streams;
pub(crate) mod words;
