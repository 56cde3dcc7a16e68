//! One signal of a recording as described by the header.

pub(crate) mod calibration;
pub(crate) mod sample_type;
pub(crate) mod unit;

use crate::ratio::Ratio;
use calibration::Calibration;
use sample_type::SampleType;
use unit::Unit;

/// Kind of a signal. Files store annotations in the form of signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalKind {
    /// Samples of a measured quantity.
    Samples,
    /// EDF+ or BDF+ annotations, which [`crate::Recording::events`] returns.
    Annotations,
}

/// One signal of a recording: its label, unit, scale and encoding.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Label exactly as in the file, without padding.
    pub label: String,
    /// Whether the signal holds samples or annotations.
    pub kind: SignalKind,
    /// Unit of the physical values.
    pub unit: Unit,
    /// Conversion from digital to physical values.
    pub calibration: Calibration,
    /// Encoding of each sample.
    pub sample_type: SampleType,
    /// Samples per record; 0 for a signal to which only events refer.
    pub samples_per_record: u32,
    /// Samples per second, Hz; `None` if a record has no samples of this signal.
    pub rate: Option<Ratio>,
}

impl Signal {
    /// Returns the size of this signal's samples in one record, bytes, < 2^35.
    pub(crate) fn record_bytes(&self) -> u64 {
        // Cannot overflow: at most 2^32 - 1 samples of 8 bytes.
        u64::from(self.samples_per_record) * self.sample_type.bytes() as u64
    }
}
