//! Records the bytes between device and host, replays recordings in the device's place, and
//! converts them to files of samples and events.
//!
//! ```text
//! port ──bytes──► Recorder ──records──► file ──► RecordingReader ─┬─► Replayer ──► port
//!                                                                 └─► convert ──► GDF, BDF, CSV, NPZ
//! ```
//!
//! [`Recorder`] and [`Replayer`] perform no I/O on a port: the caller moves the bytes and passes in
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
