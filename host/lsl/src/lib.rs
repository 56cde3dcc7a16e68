//! Lab Streaming Layer (LSL): the streams of a bridge as outlets, and an amplifier's as an inlet.
//!
//! ```text
//! publish ──► LslSink ──► queue ──► thread `lsl` ──► liblsl ──► recorders, viewers
//!             (never waits)         RowTimes: time of each sample
//!                                   ClockMap: host's clock to liblsl's
//! amplifier ──► liblsl ──► thread `lsl inlet` ──► FrameCutter ──► NeuroFrames of equal length
//! ```
//!
//! The protocol is that of the reference implementation, the C library liblsl, which is loaded when
//! it is needed. All calls of it are in `liblsl.rs`, the only file with `unsafe`.
//!
//! A push to liblsl takes locks that its network threads take too, and can allocate memory. So a
//! thread of its own pushes, with a bounded queue for each stream, and a sink never waits.
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
