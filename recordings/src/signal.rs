//! One signal of a recording, as its header describes it.

use crate::{Calibration, Ratio, SampleType, Unit};

/// What a signal carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalKind {
    /// Samples of something measured.
    Samples,
    /// EDF+ / BDF+ annotation text; read through [`crate::Recording::events`].
    Annotations,
}

/// One signal of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// The label as the file spells it, without padding.
    pub label: String,
    /// Samples or annotations.
    pub kind: SignalKind,
    /// The unit of the physical values.
    pub unit: Unit,
    /// From digital to physical values.
    pub calibration: Calibration,
    /// How a sample is stored.
    pub sample_type: SampleType,
    /// Samples in one record; 0 for a signal that only events refer to.
    pub samples_per_record: u32,
    /// Samples per second, Hz; `None` when a record holds no sample of it.
    pub rate: Option<Ratio>,
}

impl Signal {
    /// Bytes that one record holds of this signal, < 2^35.
    pub(crate) fn record_bytes(&self) -> u64 {
        // At most 8 bytes per sample.
        u64::from(self.samples_per_record) * self.sample_type.bytes() as u64
    }
}
