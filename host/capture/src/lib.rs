//! Recordings of the wire between device and host: written, replayed as a device, and converted to
//! files of samples and events.
//!
//! ```text
//! port ──bytes──► Recorder ──records──► file ──► RecordingReader ─┬─► Replayer ──► port
//!                                                                 └─► convert ──► GDF, BDF, CSV, NPZ
//! ```
//!
//! [`Recorder`] and [`Replayer`] perform no I/O on a port: the caller moves the bytes and states
//! the time. `docs/recording-format.md` describes the bytes of a file; a test compares its hex
//! dumps with what [`Recorder`] writes.
#![forbid(unsafe_code)]

mod conversion;
mod recording;

pub use conversion::{Conversion, ConvertError, ConvertSummary, FileFormat, convert};
pub use recording::handshake::Handshake;
pub use recording::reader::{LeftOut, RecordingReader};
pub use recording::recorder::Recorder;
pub use recording::replayer::{Pace, ReplayCounts, Replayer};
pub use recording::{FileHeader, Record, RecordKind, RecordingError};
