//! The network side of topics: queues and TCPROS connections, independent of the master.

pub(crate) mod inbox;
pub(crate) mod publication;
pub(crate) mod publisher_link;
pub(crate) mod subscription;
