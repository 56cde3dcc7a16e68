//! The port and what passes over it: addresses, connections, commands, who the device is.

pub(crate) mod address;
pub(crate) mod commands;
pub(crate) mod connection;
pub(crate) mod identity;
pub(crate) mod port;
