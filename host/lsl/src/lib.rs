//! Lab Streaming Layer (LSL): outlets for the bridge's streams, and an inlet for an amplifier's.
//!
//! ```text
//! publish ──► LslSink ──► queue ──► thread `lsl` ──► liblsl ──► recorders, viewers
//!             (never waits)         RowTimes: time of each sample
//!                                   ClockMap: host's clock to liblsl's
//! amplifier ──► liblsl ──► thread `lsl inlet` ──► FrameCutter ──► NeuroFrames of equal length
//! ```
//!
//! The crate uses LSL's reference implementation, the C library liblsl, which is loaded when it is
//! needed. All calls of liblsl are in `liblsl.rs`, the only file with `unsafe`.
//!
//! Pushing to liblsl takes locks that its network threads also take, and can allocate memory. A
//! separate thread therefore pushes, from a bounded queue for each stream, and sinks never wait.
#![deny(unsafe_code)]

mod clock_map;
mod description;
mod frame_cutter;
mod inlet;
mod inlet_error;
mod liblsl;
mod library;
mod outlet;
mod row_times;
mod sink;

/// What the stamp of a frame refers to, a part of [`LslOptions`].
pub use bridge_core::StampPoint;
pub use description::{Acquisition, StreamKind};
pub use inlet::{InletOptions, Received, receive};
pub use inlet_error::InletError;
pub use library::{Library, LibraryError};
pub use outlet::{Lsl, LslOptions};
pub use sink::{EventSink, FrameSink, StampScale};
