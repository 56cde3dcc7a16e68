//! Tests of nodes and masters with well-behaved and misbehaving peers, and with the programs of
//! Debian's ROS 1 where they are installed.
#![expect(clippy::unwrap_used, reason = "test support code fails by panicking")]

mod codec_properties;
#[cfg(unix)]
mod debian_ros;
mod fakes;
mod lifecycle;
mod local;
mod log;
mod misbehaving_peers;
#[cfg(unix)]
mod real_ros;
mod restart;
#[cfg(unix)]
mod rosmaster_parity;
mod services;
mod xmlrpc;
