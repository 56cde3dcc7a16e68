//! Samples from the acquisition, and its counters.

use pipeline::{Sample, Step};

use crate::marks::Marks;
use crate::order::Run;

/// A sample with the step that was due at it, on its way from the acquisition to the [`Producer`].
///
/// [`Producer`]: crate::Producer
#[derive(Clone, Debug, Default)]
pub struct AcquiredSample {
    /// The run that starts with this sample. If the queue had no room for a run's first sample, the
    /// next one that fits carries it.
    pub new_run: Option<Run>,
    /// All channels, ADC counts.
    pub sample: Sample,
    /// Index of the sample since the start.
    pub index: u64,
    /// The step, with its index since the start.
    pub step: Option<(u64, Step)>,
    /// Device time of the sample's DRDY edge, microseconds.
    pub drdy_us: u64,
    /// Faults of this sample and of those since the last one that was queued.
    pub marks: Marks,
}

/// Counters of the acquisition since boot; each wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Samples read while a run was active.
    pub samples: u64,
    /// Samples that were not read in time.
    pub overruns: u32,
    /// Samples with a wrong status word.
    pub adc_status_bad: u32,
    /// Electrode values clipped to int8, each counted once although windows overlap.
    pub clipped: u32,
}
