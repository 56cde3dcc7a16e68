//! The port to the device, the commands sent over it, and the identity that the device reports.

pub(crate) mod address;
mod clock_query;
pub(crate) mod commands;
pub(crate) mod connection;
pub(crate) mod feed;
pub(crate) mod identity;
pub(crate) mod opener;
pub(crate) mod pending;
pub(crate) mod port;
pub(crate) mod refused_start;
pub(crate) mod wanted_rate;
pub(crate) mod wanted_streams;
pub(crate) mod words;
