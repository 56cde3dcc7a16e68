//! The port to the device: its address, opening it again when it is lost, and moving bytes.

pub(crate) mod connection;
pub(crate) mod opener;
pub(crate) mod port;
