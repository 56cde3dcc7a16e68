//! EEG recordings (EDF, BDF, GDF): read, played through a virtual ADC, and written.
//!
//! Device code that reads from this crate receives the samples that an ADC would deliver, whatever
//! the rate, unit and channel order of the file. File formats are recognised by content, not by
//! file name. Below each stage, the diagram lists its types or data, then its modules:
//!
//! ```text
//! file ──> header ──> records ──────> montage ──────────> virtual ADC ──> [i32; 64]
//!          Signal     Block           weights per         resampled,      counts, i24 in i32
//!          Warning    physical units  electrode           quantised
//!          edf, gdf   recording       montage_map         virtual_adc
//! ```
//!
//! ```
//! use std::io::Cursor;
//!
//! use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};
//!
//! // An EDF file of one record of 1 s: 512 samples of Cz, each 100 uV.
//! let fields: [(&str, usize); 19] = [
//!     ("0", 8), ("patient", 80), ("recording", 80), ("01.01.24", 8), ("00.00.00", 8),
//!     ("512", 8), ("", 44), ("1", 8), ("1", 8), ("1", 4), ("Cz", 16), ("AgAgCl", 80), ("uV", 8),
//!     ("-32768", 8), ("32767", 8), ("-32768", 8), ("32767", 8), ("", 80), ("512", 8),
//! ];
//! let header: String = fields.iter().map(|(text, width)| format!("{text:width$}")).collect();
//! let mut file = format!("{header:512}").into_bytes();
//! file.extend([100, 0].repeat(512));
//!
//! let recording = Recording::from_source(Cursor::new(file))?;
//! let map = MontageMap::new(&recording.labels(), &["Cz"], Missing::Interpolate)?;
//! let mut adc = VirtualAdc::new(recording, &map, AdcSpec::ads1299(512))?;
//! assert_eq!(adc.samples(), 512);
//!
//! // 100 uV at 22.35 nV per count.
//! let sample = adc.next().expect("the first of 512 samples")?;
//! assert_eq!(sample[0], 4474);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod edf;
pub mod electrode;
mod error;
mod event;
mod format;
mod gdf;
mod header;
pub mod montage_map;
pub mod npz;
pub mod position;
mod ratio;
mod recording;
mod signal;
mod source;
mod timeline;
pub mod virtual_adc;
mod warning;

pub use edf::writer::{EdfWriter, RowAnnotation};
pub use electrode::Electrode;
pub use error::RecordingError;
pub use event::{Event, EventLabel, Onsets};
pub use format::Format;
pub use gdf::writer::GdfWriter;
pub use header::{FileToWrite, SignalToWrite};
pub use montage_map::{Missing, MontageMap, MontageMapError, MontageWarning};
pub use position::Position;
pub use ratio::Ratio;
pub use recording::{Block, Recording};
pub use signal::{Calibration, SampleType, Signal, SignalKind, Unit, UnusableRange};
pub use source::Source;
pub use virtual_adc::{AdcSpec, VirtualAdc, live_adc::LiveAdc};
pub use warning::Warning;
