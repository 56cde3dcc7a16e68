//! The host's side of the link as a state machine without input or output.
//!
//! A board sends codes (compressed EEG) and, on request, ADC samples, filtered steps, events and
//! audits. The core fits the board's clock to the host's, fills and counts lost data, decodes codes
//! to microvolts, and requests the publication of the result as `NeuroFrame` and `NeuroEvent`.
//!
//! ```text
//! bytes, times ──► Core: session ─┬─ streams ─── NeuroFrame, NeuroEvent ─► Effects
//!                    │            ├─ decoder: codes to microvolts ───────►
//!                    │            └─ diagnostics ────────────────────────►
//!     commands ◄─────┘          clock: device time to host time, for all stamps
//! ```
//!
//! [`Core`] is pure: bytes and times in, [`Effects`] out. Tests drive it without a port or a clock.
//! [`Query`] handles a single request, such as a self-test, in the same way. [`DecoderThread`] runs
//! the decoder in a thread of its own, because one window takes milliseconds. The crate `bridge`
//! connects the core to a port and to ROS; `capture` records what it receives.
//!
//! # Example
//!
//! The first command to a connected device asks it to identify itself:
//!
//! ```
//! use bridge_core::{Core, Effects, HostTime, Settings};
//! use link::{Decoder, MAX_FRAME, ToDevice};
//!
//! /// Keeps the bytes for the device and ignores all other effects.
//! #[derive(Default)]
//! struct ToPort(Vec<u8>);
//!
//! impl Effects for ToPort {
//!     fn send(&mut self, frame: &[u8]) {
//!         self.0.extend_from_slice(frame);
//!     }
//!     // The other methods, which publish frames and events, do nothing by default.
//! }
//!
//! let mut core = Core::new(Settings::default(), None);
//! let mut port = ToPort::default();
//! core.connected(HostTime::now(), &mut port);
//!
//! let mut decoder = Decoder::<MAX_FRAME>::new();
//! let command = decoder.next::<ToDevice>(&mut &port.0[..]).unwrap().unwrap();
//! assert_eq!(command.message, ToDevice::Identify);
//! ```
#![forbid(unsafe_code)]

mod core;
mod decoder;
mod device;
mod diagnostics;
mod exclusion;
mod impedance;
mod query;
mod session;
mod settings;
mod streams;
mod time;
mod wire;

pub use core::{Announcement, Core, Effects, EventPlace};
pub use decoder::audit::{AuditResult, AuditedWindow, PackedError};
pub use decoder::back_pressure::BackPressure;
pub use decoder::model::Model;
pub use decoder::packed::{PackedBytes, PackedReconstruction, TimedPackedBlock};
pub use decoder::reconstruction::{Reconstruction, TimedCode};
pub use decoder::thread::{DecoderCounts, DecoderThread};
pub use device::{Device, DeviceError, Identity};
pub use diagnostics::packed::report_malformed;
pub use exclusion::Exclusions;
pub use impedance::{Contact, ElectrodeImpedance, ImpedanceReport};
pub use neuro_ros::{TRI_LABELS, TriWords};
pub use query::report::{
    ChannelReport, ChipReport, DeviceSummary, DrdyReport, SelfTestReport, write_columns,
};
pub use query::{Answer, Query, QueryError, QueryResult, Request};
pub use session::summary::{PackedSummary, PredictionSummary, Summary};
pub use settings::{
    AnnouncedStream, Choice, EventStamps, FillerPolicy, RawForm, Settings, StampPoint, StreamKind,
    with_codes,
};
pub use streams::rows::RecordingStart;
pub use time::HostTime;
pub use time::clock::Clock;
pub use wire::upload::Upload;
