//! ROS-Neuro messages, their ROS 1 serialisation, and the services of an acquisition node.
//!
//! [`Wire`] encodes and decodes messages in the ROS 1 format. A [`Sink`] delivers messages:
//! [`RosSink`] to a ROS 1 topic, [`NdjsonSink`] as lines of JSON. A recorder requests the
//! [`AcquisitionInfo`] before the first frame. [`Shape::admit`] checks that every later frame has
//! the announced shape.
//!
//! ```text
//! NeuroFrame ──┬─> Shape::admit: same shape as announced?
//! NeuroEvent ──┼─> RosSink ── Wire ──> topic of a ros1 node
//! Diagnostics ─┴─> NdjsonSink ── JSON ──> file or pipe
//! AcquisitionInfo ──> service /acquisition/get_info ──> recorder, visualizer
//! AcquisitionCommand <── services ~start, ~stop, ~quit
//! ```
//!
//! The definitions in `ros/rosneuro_msgs/` were written from the field lists of `rosneuro_msgs`
//! alone, with other comments. MD5 sums of definitions ignore comments, so these sums equal those
//! of `rosneuro_msgs`, and the recorder, filters and visualizer of ROS-Neuro accept these messages.
//!
//! ```
//! use neuro_ros::{AcquisitionInfo, NeuroFrame, RosMessage, Wire};
//!
//! // Two samples of one channel at 512 Hz.
//! let mut frame = NeuroFrame { sr: 512, ..NeuroFrame::default() };
//! frame.eeg.info.nsamples = 2;
//! frame.eeg.info.nchannels = 1;
//! frame.eeg.info.stride = 4;
//! frame.eeg.info.labels = vec!["Cz".to_owned()];
//! for info in [&mut frame.eeg.info, &mut frame.exg.info, &mut frame.tri.info] {
//!     info.minmax = vec![-1000.0, 1000.0];
//! }
//! frame.tri.info.isint = 1;
//! frame.eeg.data = vec![12.5, -3.0];
//!
//! // The frame survives the round trip through its ROS 1 encoding.
//! assert_eq!(NeuroFrame::TYPE.name, "rosneuro_msgs/NeuroFrame");
//! assert_eq!(NeuroFrame::from_bytes(&frame.to_bytes())?, frame);
//!
//! // Once announced, frames of any other shape are refused.
//! let info = AcquisitionInfo::new("board", "1", frame.clone())?;
//! info.shape().admit(&frame)?;
//! frame.eeg.data.push(0.0);
//! assert!(info.shape().admit(&frame).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

#[cfg(feature = "ros1")]
mod acquisition;
#[cfg(feature = "ros1")]
mod definition;
mod ndjson_sink;
mod rosneuro_msgs;
mod shape;
mod sink;
mod standard_msgs;
mod status_words;
mod wire;

pub use ndjson_sink::{JsonLine, NdjsonSink, NdjsonWriter};
pub use rosneuro_msgs::{
    Header, NeuroDataFloat, NeuroDataInfo, NeuroDataInt32, NeuroDecoder, NeuroEvent, NeuroFrame,
    NeuroHeader, NeuroOutput, Stamp,
};
pub use shape::{BlockError, ContractError, Shape};
pub use sink::{FrameSink, Sink, SinkError};
pub use standard_msgs::{DiagnosticArray, DiagnosticLevel, DiagnosticStatus, KeyValue, Log, UInt8};
pub use status_words::{TRI_LABELS, TriWords};
pub use wire::{Reader, Wire, WireError};
#[cfg(feature = "ros1")]
pub use {
    acquisition::{
        AcquisitionCommand, AcquisitionInfo, AcquisitionServices, EMPTY, GET_ACQUISITION_INFO,
        GET_INFO_SERVICE,
    },
    definition::RosMessage,
    sink::RosSink,
};

/// The `ros1` crate, re-exported because [`RosSink`] and [`AcquisitionServices`] use its `Node`.
#[cfg(feature = "ros1")]
pub use ros1;
