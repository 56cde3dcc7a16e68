//! Behaviour of nodes and masters of this crate with well-behaved and misbehaving peers. Needs no
//! ROS installation.
#![expect(clippy::unwrap_used, reason = "test support code fails by panicking")]

mod delaying_proxy;
mod fake_publisher;
mod http;
#[cfg(target_os = "linux")]
mod keepalive;
mod lifecycle;
mod local;
mod misbehaving_peers;
mod refusals;
mod restart;
mod services;
mod slave_api;
#[path = "../peers/types.rs"]
mod types;
