//! Encodes the EEG of any ROS-Neuro acquisition and publishes its codes, as the paper's node does.
//!
//! A board encodes the samples of its own converters. This program subscribes to the frames of
//! another amplifier's acquisition and encodes them with the same pipeline, bit for bit as host-sim
//! encodes a recording of the same samples. The bridge's core publishes the codes, so subscribers
//! see no difference between a board and this program.
//!
//! ```text
//! /neurodata ─► Layout, Sequence, Pauses ─► LiveAdc ─► EncoderDevice ─► bridge ─► /encoded
//! NeuroFrame    checks, gaps, time          counts     codes, frames    core
//! ```
//!
//! [`Source`] is pure: frames and times in, bytes of a device out. [`run`] is the program.
//!
//! ```
//! use neuro_ros::{NeuroDataFloat, NeuroDataInfo, NeuroFrame};
//! use node::Layout;
//!
//! let info = NeuroDataInfo { nsamples: 2, nchannels: 1, labels: vec!["Cz".into()], ..Default::default() };
//! let eeg = NeuroDataFloat { info, data: vec![1.0, 2.0] };
//! let frame = NeuroFrame { sr: 512, eeg, ..Default::default() };
//! assert_eq!(Layout::from_frame(&frame)?.to_string(), "2 samples of 1 electrodes at 512 Hz");
//!
//! let slow = NeuroFrame { sr: 100, ..frame };
//! let refusal = Layout::from_frame(&slow).unwrap_err();
//! assert!(refusal.to_string().contains("100 Hz"));
//! # Ok::<(), node::Refusal>(())
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod amplifier_clock;
mod app;
mod command_line;
mod encoder_device;
mod feed;
mod frames;
mod layout;
mod pauses;
mod refusal;
mod sequence;
mod source;
mod source_status;

pub use app::run;
pub use encoder_device::EncoderDevice;
pub use layout::Layout;
pub use refusal::Refusal;
pub use sequence::{Arrival, Sequence};
pub use source::{Source, SourceCounts};
