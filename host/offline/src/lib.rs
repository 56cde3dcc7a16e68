//! Encodes EEG recordings to files of neural-network codes or packed blocks, decodes these to
//! signals, and measures the error of the decoded signals, without a board, a bridge or a clock.
//!
//! Pipeline and wire format are the firmware's code, and the decoder is the bridge's. So codes and
//! microvolts equal those of a board and its bridge bit for bit. The commands `host-sim encode` and
//! `host-sim decode` run [`Encoding`] and [`Decoding`] for many files at once.
//!
//! ```text
//! recording ──Played: virtual ADC──► Device: pipeline ──frames──► file of codes
//!     │                                                               │ CodeFile: codes
//!     └──Original: filtered EEG──► Comparison ◄──microvolts── Hops: decoder, overlap; or Blocks: packed decoder
//!                                      │                              │
//!                                    report                SignalFile: EDF, BDF, GDF, NPZ, CSV
//! ```
#![forbid(unsafe_code)]

mod code_file;
mod comparison;
mod decoding;
mod encoding;
mod error;
mod exclusions;
mod histogram;
mod hops;
mod model;
mod played;
mod progress;
pub mod report;
mod row_events;
mod signal_file;
mod survey;

pub use code_file::{CodeFileError, CodeKind};
pub use comparison::{Comparison, ElectrodeOrigin, ElectrodeSums, Excerpt, settling_s};
pub use decoding::{Decoded, Decoding};
pub use encoding::{Encoded, EncodedStream, Encoding, PackedCounts};
pub use error::OfflineError;
pub use histogram::{BINS, LevelHistogram};
pub use model::Model;
pub use played::{Played, first_channels, microvolts};
pub use progress::Progress;
pub use signal_file::SignalFormat;
