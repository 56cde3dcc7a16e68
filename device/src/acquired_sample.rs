//! Samples that the acquisition passes to the producer, and the acquisition's counters.

use pipeline::{Sample, Step};

use crate::marks::Marks;
use crate::order::Run;

/// One ADC sample from the acquisition, with the filtered step that is due at this sample. Input of
/// the [`Producer`].
///
/// [`Producer`]: crate::Producer
#[derive(Clone, Debug, Default)]
pub struct AcquiredSample {
    /// The run that starts with this sample; `None` within a run. If the queue to the producer had
    /// no room for the first sample of a run, the next queued sample carries the run.
    pub new_run: Option<Run>,
    /// ADC counts of all channels.
    pub sample: Sample,
    /// Index of the sample in its run, from 0.
    pub index: u64,
    /// Index in the run and value of the filtered step that is due at this sample; `None` if no
    /// step is due.
    pub step: Option<(u64, Step)>,
    /// Device time of the sample's DRDY edge, microseconds.
    pub drdy_us: u64,
    /// Faults of this sample, and of the samples directly before it that found no room in the
    /// queue.
    pub marks: Marks,
}

/// Counters of the acquisition since boot; each wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Samples read while a run was active.
    pub samples: u64,
    /// Samples that were not read in time, or that found no room in the queue to the producer.
    pub overruns: u32,
    /// Samples with a wrong status word.
    pub adc_status_bad: u32,
    /// Electrode values clipped to int8, each counted once although windows overlap.
    pub clipped: u32,
}
