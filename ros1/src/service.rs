//! Services as the network sees them: the provider's side and the client's side.

pub(crate) mod client;
pub(crate) mod provider;
