//! EEG recordings (EDF, BDF, GDF) played through a virtual ADC.
//!
//! A file goes through four stages, one module group each:
//!
//! | Stage | Type out | Unit | Modules |
//! | --- | --- | --- | --- |
//! | header | [`Signal`]s, [`Warning`]s | | `edf`, `gdf`, `header` |
//! | records | [`Block`] | the signal's own | `source`, `recording`, `sample_type`, `calibration` |
//! | montage | weights per electrode | | [`electrode`], [`position`], [`montage_map`] |
//! | virtual ADC | `[i32; 64]` | counts, i24 in i32 | [`virtual_adc`] |
//!
//! The device path behind this crate therefore sees what an ADC would give it, whatever the
//! file's rate, unit or channel order was. Formats are told apart by content, never by name.
#![forbid(unsafe_code)]

mod calibration;
mod edf;
pub mod electrode;
mod error;
mod event;
mod format;
mod gdf;
mod gdf_events;
mod gdf_record_count;
mod header;
pub mod montage_map;
pub mod position;
mod rate_converter;
mod ratio;
mod recording;
mod sample_type;
mod signal;
mod source;
mod tal;
mod unit;
pub mod virtual_adc;
mod warning;

pub use calibration::Calibration;
pub use electrode::Electrode;
pub use error::RecordingError;
pub use event::{Event, EventLabel};
pub use format::Format;
pub use montage_map::{Missing, MontageMap, MontageMapError};
pub use position::Position;
pub use ratio::Ratio;
pub use recording::{Block, Recording};
pub use sample_type::SampleType;
pub use signal::{Signal, SignalKind};
pub use source::Source;
pub use unit::Unit;
pub use virtual_adc::{AdcSpec, VirtualAdc};
pub use warning::Warning;
