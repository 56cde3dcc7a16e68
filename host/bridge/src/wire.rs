//! The port to the device.

pub(crate) mod address;
pub(crate) mod connection;
pub(crate) mod feed;
pub(crate) mod opener;
pub(crate) mod port;
