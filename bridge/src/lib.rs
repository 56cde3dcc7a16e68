//! Frames from the board, republished as ROS-Neuro NeuroFrames.
//!
//! [`Core`] is the bridge without the world: it takes bytes and times and gives [`Effects`]. In it
//! the [`Clock`] tells when a sample was taken, the [`Ledger`] what was lost, and the
//! [`Reconstruction`] what the electrodes saw. [`run`] ties it to a port, to ROS and to the
//! clock on the wall. [`Inquiry`] is one question to a device, such as to test itself; [`inquire`]
//! ties that to a port.
#![forbid(unsafe_code)]

mod audit;
mod clock;
mod code_stream;
mod commands;
mod connection;
mod converters;
mod core;
mod decoding;
mod device;
mod diagnosis;
mod effects;
mod error;
mod event_stream;
mod frames;
mod host_time;
mod identity;
mod inquire;
mod inquiry;
mod leave;
mod ledger;
mod lower_hull;
mod model;
mod moment;
mod monotone;
mod options;
mod outlets;
mod port;
mod port_address;
mod reconstruction;
mod ros;
mod round_trip;
mod run;
mod sample_stream;
mod self_test_report;
mod self_test_table;
mod session;
mod settings;
mod side_streams;
mod signal_quality;
mod sinks;
mod summary;
mod task;
mod timing;
mod tri;
mod trigger;

pub use audit::{AuditResult, AuditedWindow};
pub use clock::Clock;
pub use core::Core;
pub use device::{Device, DeviceError};
pub use effects::{Announcement, Effects};
pub use error::BridgeError;
pub use host_time::HostTime;
pub use inquire::inquire;
pub use inquiry::{Answer, Inquiry, Outcome, Question};
pub use ledger::{Arrival, Ledger};
pub use model::Model;
pub use options::{Options, PortOptions, SinkKind};
pub use port_address::PortAddress;
pub use reconstruction::{Reconstruction, TimedCode};
pub use run::run;
pub use self_test_report::{ChannelReport, ChipReport, DeviceLine, ReadyReport, SelfTestReport};
pub use settings::{AnnouncedStream, FillerPolicy, Settings, StampPoint, StreamKind};
pub use summary::Summary;
pub use task::{ResetOptions, SelfTestOptions, Task};
pub use tri::{TRI_LABELS, TriWords};
