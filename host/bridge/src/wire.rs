//! The port to the device: its address, its reopening after a loss, and the transfer of bytes.

pub(crate) mod connection;
pub(crate) mod opener;
pub(crate) mod port;
