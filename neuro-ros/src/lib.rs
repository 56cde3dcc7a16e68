//! ROS-Neuro messages, the contract of its acquisition node, and sinks.
//!
//! The values ([`NeuroFrame`], [`NeuroEvent`], [`DiagnosticArray`] and their parts) know nothing
//! about where they go; [`Wire`] writes and reads them as ROS 1 does, and a [`Sink`] delivers
//! them: [`RosSink`] to a ROS 1 topic, [`NdjsonSink`] as lines of JSON. [`AcquisitionInfo`] is
//! what the recorder asks an acquisition for, and holds every later frame to that answer.
//!
//! The definitions under `msg/` and `srv/` were written from the field lists of `rosneuro_msgs`
//! alone; the MD5 sums, which ignore comments, are those of that package, so its recorder,
//! filters and visualizer talk to us.
#![forbid(unsafe_code)]

mod acquisition_info;
mod acquisition_services;
mod definition;
mod diagnostics;
mod header;
mod ndjson_sink;
mod neuro_data;
mod neuro_event;
mod neuro_frame;
mod ros_sink;
mod shape;
mod sink;
mod stamp;
mod wire;

pub use acquisition_info::AcquisitionInfo;
pub use acquisition_services::{
    AcquisitionCommand, AcquisitionServices, EMPTY, GET_ACQUISITION_INFO, GET_INFO_SERVICE,
};
pub use definition::RosMessage;
pub use diagnostics::{DiagnosticArray, DiagnosticLevel, DiagnosticStatus, KeyValue};
pub use header::{Header, NeuroHeader};
pub use ndjson_sink::{NdjsonSink, NdjsonWriter};
pub use neuro_data::{NeuroDataFloat, NeuroDataInfo, NeuroDataInt32};
pub use neuro_event::NeuroEvent;
pub use neuro_frame::NeuroFrame;
pub use ros_sink::RosSink;
pub use shape::{ContractError, Shape};
pub use sink::{FrameSink, Sink, SinkError};
pub use stamp::Stamp;
pub use wire::{Reader, Wire, WireError};

/// The ROS 1 node that [`RosSink`] and [`AcquisitionServices`] run on.
pub use ros1;
