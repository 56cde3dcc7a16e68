//! Acceptance tests: they start programs as a user does, and check them from outside, end to end.
//!
//! Each file of `tests/` checks one promise. This library starts and stops what the tests need: the
//! workspace's own programs, emulated boards, ROS and numpy.
//!
//! ```text
//! host-sim or QEMU ── PTY or TCP ──> bridge ──> roscore ──> rospy subscriber, rosbag
//!                     Chain: starts them, collects the messages, stops them
//! ```
//!
//! ```
//! use acceptance::workspace;
//!
//! let packages = workspace::packages("Cargo.toml").expect("cargo metadata");
//! assert!(packages.iter().any(|package| package.name == "bridge"));
//! ```
#![forbid(unsafe_code)]

pub mod browser;
pub mod catkin;
pub mod chain;
pub mod emulated_board;
pub mod files;
pub mod lossy_cable;
pub mod lsl_recording;
pub mod numpy_reference;
pub mod other_model;
pub mod port;
pub mod printing;
pub mod process;
pub mod programs;
pub mod real_data;
pub mod ros;
pub mod ros2;
pub mod ros_messages;
pub mod wheels;
pub mod workspace;
