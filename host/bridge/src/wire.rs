//! The port to the device.

pub(crate) mod connection;
pub(crate) mod opener;
pub(crate) mod port;
