//! Lab Streaming Layer (LSL): outlets for the bridge's streams, and an inlet for the stream of an
//! amplifier.
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
//! Pushing to liblsl takes locks that its network threads also take, and can allocate memory.
//! Therefore a separate thread pushes samples from a bounded queue for each stream, and sinks never
//! wait.
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

/// Point in time to which a frame's stamp refers; a field of [`LslOptions`].
pub use bridge_core::StampPoint;
pub use description::{Acquisition, StreamKind};
pub use inlet::{InletOptions, Received, receive};
pub use inlet_error::InletError;
pub use library::{Library, LibraryError};
pub use outlet::{Lsl, LslOptions};
pub use sink::{EventSink, FrameSink, StampScale};
