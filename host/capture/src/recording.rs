//! Recordings of the wire: every byte between device and host, with the time at which it was read.
//!
//! ```text
//! port ──bytes──► Recorder: splitter ──records──► file ──► RecordingReader ─┬─► Replayer ──► port
//!                                                                           └─► Playback ──► Core
//! ```
//!
//! `docs/recording-format.md` describes the bytes of a file; a test compares its hex dumps with
//! what this module writes.

pub(crate) mod error;
pub(crate) mod file_header;
pub(crate) mod introduction;
pub(crate) mod reader;
pub(crate) mod record;
pub(crate) mod recorded_starts;
pub(crate) mod recorder;
pub(crate) mod replay_counts;
pub(crate) mod replayer;
pub(crate) mod splitter;
