//! The port to the device: its address, opening and reopening it, and moving bytes.

pub(crate) mod connection;
pub(crate) mod opener;
pub(crate) mod port;
