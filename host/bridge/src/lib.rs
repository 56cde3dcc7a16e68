//! Publishes the codes and signals of a Corticode board as ROS-Neuro messages.
//!
//! A board sends codes (compressed EEG) and, on request, ADC samples, filtered steps, events and
//! audits. The bridge fits the board's clock to the host's, fills and counts lost data, decodes
//! codes to microvolts, and publishes the result as `NeuroFrame` and `NeuroEvent`.
//!
//! ```text
//! port ──bytes──► Core: session ─┬─ streams ─── NeuroFrame, NeuroEvent ─┬─► ROS topics
//!  ▲                │            ├─ decoder thread: codes to uV ────────┤   or lines of JSON
//!  │                │            └─ diagnostics ────────────────────────┘
//!  └─── commands ───┘          clock: device time to host time, for all stamps
//! ```
//!
//! [`Core`] is pure: bytes and times in, [`Effects`] out. Tests drive it without a port or a clock.
//! [`run`] is the program `corticode-bridge`, which connects the core to a port and to ROS.
//! A [`Publication`] does the same for a program that is a device itself and implements [`Feed`].
//! [`Query`] is the pure part of its subcommands `selftest` and `reset`.
//!
//! # Example
//!
//! The first command to a connected device asks it to identify itself:
//!
//! ```
//! # use bridge::{Announcement, AuditedWindow, TimedPackedBlock, TimedCode};
//! # use neuro_ros::{NeuroEvent, NeuroFrame};
//! use bridge::{AnnouncedStream, Core, Effects, EventStamps, FillerPolicy, HostTime, Settings, StampPoint};
//! use link::{Decoder, MAX_FRAME, Streams, ToDevice};
//!
//! /// Keeps the bytes for the device and ignores all other effects.
//! #[derive(Default)]
//! struct ToPort(Vec<u8>);
//!
//! impl Effects for ToPort {
//!     fn send(&mut self, frame: &[u8]) {
//!         self.0.extend_from_slice(frame);
//!     }
//! #   fn announce(&mut self, _: &Announcement) {}
//! #   fn publish_encoded(&mut self, _: &NeuroFrame) {}
//! #   fn decode(&mut self, _: TimedCode) {}
//! #   fn decode_block(&mut self, _: TimedPackedBlock) {}
//! #   fn publish_raw(&mut self, _: &NeuroFrame) {}
//! #   fn publish_filtered(&mut self, _: &NeuroFrame) {}
//! #   fn publish_event(&mut self, _: &NeuroEvent) {}
//! #   fn audit(&mut self, _: AuditedWindow) {}
//!     // The other methods publish frames and events.
//! }
//!
//! let settings = Settings {
//!     stamp: StampPoint::First,
//!     mains_hz: 50,
//!     filler: FillerPolicy::Last,
//!     low_latency: false,
//!     announced: AnnouncedStream::Encoded,
//!     streams: Streams::CODES,
//!     packed_rate: None,
//!     event_stamps: EventStamps::Scalp,
//! };
//! let mut core = Core::new(settings, None);
//! let mut port = ToPort::default();
//! core.connected(HostTime::now(), &mut port);
//!
//! let mut decoder = Decoder::<MAX_FRAME>::new();
//! let command = decoder.next::<ToDevice>(&mut &port.0[..]).unwrap().unwrap();
//! assert_eq!(command.message, ToDevice::Identify);
//! ```
#![forbid(unsafe_code)]

mod app;
mod columns;
mod config_error;
mod conversion;
mod core;
mod decoder;
mod device;
mod diagnostics;
mod doctor;
mod effects;
mod error;
mod ports;
mod query;
mod recording;
mod session;
mod settings;
mod streams;
mod time;
mod wire;

pub use app::bridge::Publication;
pub use app::command_line::ignore_empty_variable;
pub use app::log::start as start_log;
pub use app::namespace::Namespace;
pub use app::parameters::{read as read_parameters, to_flags as parameters_to_flags};
pub use app::run;
pub use config_error::ConfigError;
pub use core::Core;
pub use decoder::audit::{AuditResult, AuditedWindow, PackedError};
pub use decoder::counts::DecoderCounts;
pub use decoder::model::Model;
pub use decoder::packed::{PackedBytes, PackedReconstruction, TimedPackedBlock};
pub use decoder::reconstruction::{Reconstruction, TimedCode};
pub use device::{Device, DeviceError};
pub use diagnostics::summary::{PackedSummary, Summary};
pub use effects::{Announcement, Effects};
pub use error::BridgeError;
pub use neuro_ros::{TRI_LABELS, TriWords};
pub use query::protocol::{Answer, Query, QueryResult, Request};
pub use query::report::{ChannelReport, ChipReport, DeviceSummary, DrdyReport, SelfTestReport};
pub use recording::error::RecordingError;
pub use recording::file_header::FileHeader;
pub use recording::reader::{LeftOut, RecordingReader};
pub use recording::record::{Record, RecordKind};
pub use recording::recorder::Recorder;
pub use recording::replay_counts::ReplayCounts;
pub use recording::replayer::{Pace, Replayer};
pub use settings::{
    AnnouncedStream, EventStamps, FillerPolicy, RawForm, Settings, StampPoint, StreamKind,
};
pub use streams::ledger::{Arrival, Ledger};
pub use time::clock::Clock;
pub use time::host_time::HostTime;
pub use wire::connection::Event as FeedEvent;
pub use wire::feed::Feed;
