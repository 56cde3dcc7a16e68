//! How nodes and masters of ours behave among peers of every kind, without ROS installed.
#![expect(clippy::unwrap_used, reason = "a helper of a test fails by panicking")]

mod abuse;
mod fake_publisher;
mod held_master;
mod http;
#[cfg(target_os = "linux")]
mod keepalive;
mod lifecycle;
mod local;
mod refusals;
mod restart;
mod services;
mod slave_api;
#[path = "../peers/types.rs"]
mod types;
