//! A ROS 2 node without a ROS installation: NeuroFrames, events, reports and services over DDS.
//!
//! ```text
//! NeuroFrame, NeuroEvent, ... ──► Ros2Sink ──► DDS writer (8192 messages) ──► subscribers
//! AcquisitionInfo ──► Ros2Node::announce ─┬─► topic neurodata_info, kept for late subscribers
//!                                         └─► service get_info
//! AcquisitionCommand ◄── services start, stop, quit
//! ```
//!
//! The messages of `neuro-ros` are published with the definitions in `ros/ros2/ros2neuro_msgs/`,
//! which were written from the field lists of ROS 2-Neuro. Publishing never waits: a message goes
//! into the memory of its DDS writer, whose threads send it. If there is no room, because a
//! reliable subscriber has acknowledged none of the newest 8192 messages, a message is dropped and
//! counted. Messages wait while the node joins its domain again after a stop of the process.
//!
//! All names are full names, such as `/left/encoded`; the caller resolves and remaps them.
//!
//! ```no_run
//! use neuro_ros::{NeuroFrame, Sink};
//! use ros2::{Delivery, Domain, Ros2Node, ServiceNames};
//!
//! let name = |service| format!("/acquisition/{service}");
//! let services = ServiceNames {
//!     start: name("start"),
//!     stop: name("stop"),
//!     quit: name("quit"),
//!     get_info: name("get_info"),
//! };
//! let domain = Domain { id: 0, localhost_only: false };
//! let node = Ros2Node::start("/acquisition", domain, &services, |_command| {})?;
//! let mut sink = node.sink("/encoded", Delivery::Reliable)?;
//! sink.publish(&NeuroFrame::default())?;
//! assert_eq!(sink.dropped(), 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod domain;
mod messages;
mod node;
mod presence;
mod services;
mod sink;
mod topic;

pub use domain::{Domain, Ros2Error};
pub use messages::{
    DiagnosticArray, DiagnosticStatus, GetAcquisitionInfo, Header, KeyValue, Log, NeuroDataFloat,
    NeuroDataInfo, NeuroDataInt32, NeuroDecoder, NeuroEvent, NeuroFrame, NeuroHeader, NeuroOutput,
    Ros2Message, Time,
};
pub use node::Ros2Node;
pub use services::ServiceNames;
pub use sink::{Delivery, Ros2Sink};
