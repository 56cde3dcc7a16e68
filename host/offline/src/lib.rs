//! Encodes recordings to files of codes or of packed blocks, decodes these to files of signals, and
//! measures the error of the decoded signals, without a board, a bridge or a clock.
//!
//! The pipeline and the link are the firmware's, and the decoder is the bridge's, so codes and
//! microvolts equal theirs bit for bit. The commands `host-sim encode` and `host-sim decode` run
//! [`Encoding`] and [`Decoding`] for many files at once.
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
