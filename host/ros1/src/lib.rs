//! A ROS 1 node and a ROS 1 master, without any ROS installation.
//!
//! [`Node`] publishes topics, subscribes to them, provides services and calls them. [`Master`]
//! replaces rosmaster in demonstrations and tests. Message bodies are opaque bytes: the user of
//! this crate serialises them.
//!
//! ```text
//! publish() ──> queue per subscriber ══ TCPROS ══> queue per topic ──> recv()
//!     │                                                 ▲
//!     └── registers ──> master ── lists publishers ─────┘        (XML-RPC)
//!
//! call() ── request ══ TCPROS ══> handler ── response ══ TCPROS ══> returned by call()
//! ```
//!
//! A node guarantees:
//!
//! * A node needs no running master. It registers once a master is running, and again within two
//!   seconds after the master's restart. Open connections are not affected by a restart.
//! * [`Publisher::publish`] never waits. Each subscriber has a bounded queue. When the queue is
//!   full, it drops its oldest message and counts the loss, so a slow subscriber affects nobody
//!   else.
//! * Everything received from a peer has a size limit. Connecting, handshakes and XML-RPC calls
//!   have time limits. Waiting for a service's response has no limit, because a handler can take
//!   any time.
//! * Topics and persistent service clients can be silent for any time. If the peer's machine
//!   vanishes, TCP keepalive closes the idle connection within 30 s. If sent data is still
//!   unacknowledged, the operating system retransmits it first, for about 15 min on Linux. A full
//!   queue drops and counts messages meanwhile.
//! * A publisher that cannot be reached is logged once, and once more when it can be reached again.
//!   Until then, [`Subscriber::unreachable`] returns the reason.
//! * `TCP_NODELAY` is set on every connection, proxies are never used, and both IPv4 and IPv6 work.
//!
//! ```
//! use std::net::SocketAddr;
//!
//! use ros1::{Master, MessageType, Node, NodeOptions, PublisherOptions};
//!
//! static STRING: MessageType = MessageType {
//!     name: "std_msgs/String",
//!     md5: "992ce8a1687cec8c8bd883ec73ca41d1",
//!     definition: "string data\n",
//! };
//!
//! #[tokio::main]
//! async fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let master = Master::start(SocketAddr::from(([127, 0, 0, 1], 0))).await?;
//!     let talker = Node::start(NodeOptions::new("talker", master.uri())).await?;
//!     let listener = Node::start(NodeOptions::new("listener", master.uri())).await?;
//!
//!     // A latched message also reaches subscribers that connect later.
//!     let options = PublisherOptions { queue: 8, latch: true };
//!     let publisher = talker.advertise("chatter", &STRING, options).await?;
//!     publisher.publish(b"\x05\0\0\0hello");
//!
//!     let mut subscriber = listener.subscribe("chatter", &STRING, 8).await?;
//!     let message = subscriber.recv().await;
//!     assert_eq!(message.as_deref(), Some(&b"\x05\0\0\0hello"[..]));
//!
//!     listener.shutdown().await;
//!     talker.shutdown().await;
//!     master.shutdown().await;
//!     Ok(())
//! }
//! ```
#![forbid(unsafe_code)]

mod address;
mod http;
mod master;
mod names;
mod node;
mod publication;
mod service;
mod subscription;
mod sync;
pub mod tcpros;
pub mod xmlrpc;

pub use address::{AddressError, ConnectError, LookupError, host_addresses};
pub use http::HttpError;
pub use master::Master;
pub use names::{NameError, Names};
pub use node::{
    Node, NodeError,
    handles::{Publisher, Service, Subscriber},
    options::{DEFAULT_MASTER_URI, NodeOptions},
    registrar::{MasterStatus, SystemState},
};
pub use publication::{PublisherOptions, SubscriberLag};
pub use service::{ServiceClient, ServiceError};
pub use tcpros::{MessageType, ServiceType};
