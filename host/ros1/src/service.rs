//! The network side of services: the provider and the client.

pub(crate) mod client;
pub(crate) mod provider;
