//! Samples on their way from the acquisition to the producer, and the counters of the acquisition.

use pipeline::{Sample, Step};

use crate::marks::Marks;
use crate::order::Run;

/// A sample, with the filtered step that was due at it, on its way from the acquisition to the
/// [`Producer`].
///
/// [`Producer`]: crate::Producer
#[derive(Clone, Debug, Default)]
pub struct AcquiredSample {
    /// The run that starts with this sample. If the queue had no room for a run's first sample, the
    /// next one that fits carries it.
    pub new_run: Option<Run>,
    /// Counts of the ADC, one per channel.
    pub sample: Sample,
    /// Index of the sample since the start of the run, from 0.
    pub index: u64,
    /// The step that was due at this sample, with the step's index since the start of the run;
    /// `None` for samples without a step.
    pub step: Option<(u64, Step)>,
    /// Device time of the sample's DRDY edge, microseconds.
    pub drdy_us: u64,
    /// Faults of this sample, and of the samples before it that found no room in the queue.
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
