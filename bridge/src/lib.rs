//! Frames from the board, republished as ROS-Neuro NeuroFrames.
#![forbid(unsafe_code)]

mod app;
mod core;
mod decoder;
mod device;
mod diagnostics;
mod effects;
mod error;
mod query;
mod session;
mod settings;
mod streams;
mod time;
mod wire;

pub use app::run;
pub use core::Core;
pub use decoder::audit::{AuditResult, AuditedWindow};
pub use decoder::model::Model;
pub use decoder::reconstruction::{Reconstruction, TimedCode};
pub use device::{Device, DeviceError};
pub use diagnostics::summary::Summary;
pub use effects::{Announcement, Effects};
pub use error::BridgeError;
pub use query::protocol::{Answer, Query, QueryResult, Request};
pub use query::report::{ChannelReport, ChipReport, DeviceSummary, DrdyReport, SelfTestReport};
pub use settings::{AnnouncedStream, FillerPolicy, Settings, StampPoint, StreamKind};
pub use streams::ledger::{Arrival, Ledger};
pub use streams::tri::{TRI_LABELS, TriWords};
pub use time::clock::Clock;
pub use time::host_time::HostTime;
