//! Samples that the acquisition passes to the producer, and the acquisition's counters.

use model::{ADC_RATE_HZ, STEP_RATE_HZ};
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
    /// Index in the run of the step to which this sample belongs: the step that is due at it, or the
    /// next one.
    pub step_index: u64,
    /// The filtered step that is due at this sample; `None` if no step is due.
    pub step: Option<Step>,
    /// Device time of the sample's DRDY edge, microseconds.
    pub drdy_us: u64,
    /// Faults of this sample.
    pub marks: Marks,
    /// Faults of the samples directly before this one that found no room in the queue, an overrun
    /// included; no faults if there are none.
    pub lost: Marks,
}

impl AcquiredSample {
    /// Returns the index of the ADC sample at or before step `step` of the run, and the device time
    /// of the step, microseconds. The time is computed from that of this sample at the nominal rates.
    pub(crate) fn place_of_step(&self, step: u64) -> (u64, u64) {
        let (adc_hz, step_hz) = (u64::from(ADC_RATE_HZ), u64::from(STEP_RATE_HZ));
        let since_start_us = |count: u64, hz: u64| count * 1_000_000 / hz;
        let at_us = self.drdy_us + since_start_us(step, step_hz);
        (
            step * adc_hz / step_hz,
            at_us.saturating_sub(since_start_us(self.index, adc_hz)),
        )
    }
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
