//! The commands sent to the device, and the identity that it reports.

pub(crate) mod commands;
pub(crate) mod wanted;
pub(crate) mod words;
