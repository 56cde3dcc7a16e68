//! Topics as the network sees them: queues and TCPROS connections. Nothing here knows the master.

pub(crate) mod inbox;
pub(crate) mod publication;
pub(crate) mod publisher_link;
pub(crate) mod subscription;
