//! A small, sturdy ROS 1 node and master.
//!
//! Message bodies are opaque bytes: whoever uses this crate serialises them. What a node promises:
//!
//! * It needs no living master, registers when there is one, and again within two seconds after
//!   a restart; connections that live are left alone.
//! * [`Publisher::publish`] never waits. Each subscriber has a bounded queue that drops its
//!   oldest message and counts it, so a slow subscriber disturbs nobody.
//! * Everything a peer sends has a limit of size and, where someone waits for it, of time. Topics
//!   and persistent service clients may be silent for ever: TCP keepalive ends their connections
//!   within half a minute when the peer's machine has vanished. To one with messages still under
//!   way the system sends them again for as long as it is set to (a quarter of an hour on Linux);
//!   its queue drops and counts meanwhile.
//! * `TCP_NODELAY` on every connection; never a proxy; IPv4 and IPv6.
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
//!     // A latched message reaches subscribers that come later.
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
mod drop_oldest;
mod graph;
mod http;
mod incoming;
mod inlet;
mod lock;
mod master;
mod message_type;
mod names;
mod node;
mod options;
mod publisher;
mod registrar;
mod service;
mod service_client;
mod slave;
mod subscriber;
pub mod tcpros;
pub mod xmlrpc;

pub use address::AddressError;
pub use http::HttpError;
pub use master::Master;
pub use message_type::{MessageType, ServiceType};
pub use names::NameError;
pub use node::{Node, NodeError};
pub use options::{DEFAULT_MASTER_URI, NodeOptions};
pub use publisher::{Publisher, PublisherOptions};
pub use service::Service;
pub use service_client::{ServiceClient, ServiceError};
pub use subscriber::Subscriber;
