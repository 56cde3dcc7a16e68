//! Samples from the acquisition to the producer, their faults, and the acquisition's counters.

use link::Flags;
use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ, STEPS};
use pipeline::{Sample, Step};

use crate::board::Run;

/// One ADC sample from the acquisition, with the filtered step that is due at this sample. Input of
/// the [`Producer`].
///
/// [`Producer`]: crate::Producer
#[derive(Clone, Debug, Default)]
pub struct AcquiredSample {
    /// The run, if it starts with this sample; `None` for later samples. If the queue to the
    /// producer had no room for the first sample of a run, the next queued sample carries the run.
    pub new_run: Option<Run>,
    /// ADC counts of all channels.
    pub sample: Sample,
    /// Index of the sample, counted from 0 at the start of the run.
    pub index: u64,
    /// Index of the step to which this sample belongs, counted from the start of the run: the step
    /// that is due at this sample, or else the next step.
    pub step_index: u64,
    /// The filtered step that is due at this sample; `None` if no step is due.
    pub step: Option<Step>,
    /// Device time of the sample's DRDY edge, microseconds.
    pub drdy_us: u64,
    /// Faults of this sample.
    pub marks: Marks,
    /// Faults of the samples that were lost, because the queue was full, between the previous
    /// queued sample and this one; they include `overrun`. No faults if no sample was lost.
    pub lost: Marks,
    /// True if the excitation flows through the electrodes; their impedance is measured from it.
    pub excited: bool,
}

impl AcquiredSample {
    /// Returns the index of the ADC sample at or before step `step` of the run, and the device time
    /// of the step, microseconds. The time is computed from this sample's time at the nominal
    /// rates.
    pub(crate) fn place_of_step(&self, step: u64) -> (u64, u64) {
        let (adc_hz, step_hz) = (u64::from(ADC_RATE_HZ), u64::from(STEP_RATE_HZ));
        let since_start_us = |count: u64, hz: u64| count * 1_000_000 / hz;
        let at_us = self.drdy_us + since_start_us(step, step_hz);
        (step * adc_hz / step_hz, at_us.saturating_sub(since_start_us(self.index, adc_hz)))
    }
}

/// Counters of the acquisition since boot; each wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Samples read while a run was active.
    pub samples: u64,
    /// Samples that were not read in time, or for which the queue to the producer had no room.
    pub overruns: u32,
    /// Samples in which a converter's status word was wrong.
    pub adc_status_bad: u32,
    /// Electrode values clipped to int8, each counted once although windows overlap:
    /// [`Producer::clipped`](crate::Producer::clipped).
    pub clipped: u32,
}

/// Faults of a sample or a window that [`pipeline::Acquisition`] does not detect.
#[expect(clippy::struct_excessive_bools, reason = "each of them can be true with any other")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Marks {
    /// A status word of the ADC chain was wrong.
    pub adc_status_bad: bool,
    /// The ADC's lead-off detection reported an electrode without contact.
    pub lead_off: bool,
    /// A sample was lost: it was not read in time, or a queue was full.
    pub overrun: bool,
    /// An electrode was excluded, and its values were filled from the others.
    pub substituted: bool,
}

impl Marks {
    /// Marks of a sample without faults.
    pub const NONE: Self =
        Self { adc_status_bad: false, lead_off: false, overrun: false, substituted: false };

    /// Returns the faults that at least one of the two operands has.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self {
            adc_status_bad: self.adc_status_bad | other.adc_status_bad,
            lead_off: self.lead_off | other.lead_off,
            overrun: self.overrun | other.overrun,
            substituted: self.substituted | other.substituted,
        }
    }

    /// Converts the faults to wire flags.
    pub(crate) fn flags(self) -> Flags {
        [
            (self.adc_status_bad, Flags::ADC_STATUS_BAD),
            (self.lead_off, Flags::LEAD_OFF),
            (self.overrun, Flags::OVERRUN),
            (self.substituted, Flags::SUBSTITUTED),
        ]
        .into_iter()
        .filter(|(set, _)| *set)
        .fold(Flags::empty(), |flags, (_, flag)| flags | flag)
    }
}

/// Faults of the newest window, stored for each hop, because consecutive windows share hops.
#[derive(Clone, Debug)]
pub(crate) struct WindowMarks {
    /// Number of steps since the start of the run.
    steps: u64,
    /// Faults of the hops that the newest window covers, newest hop first.
    hops: [Marks; STEPS.div_ceil(HOP)],
}

impl WindowMarks {
    pub(crate) const NONE: Self = Self { steps: 0, hops: [Marks::NONE; STEPS.div_ceil(HOP)] };

    /// Adds faults to the step that is not yet complete.
    pub(crate) fn mark(&mut self, marks: Marks) {
        self.hops[0] = self.hops[0].union(marks);
    }

    /// Returns the faults that have occurred so far in the newest hop, including the faults of the
    /// step that is not yet complete.
    pub(crate) const fn newest_hop(&self) -> Marks {
        self.hops[0]
    }

    /// Ends a step and returns the faults of the window that ends with this step.
    pub(crate) fn end_step(&mut self) -> Marks {
        let window = self.hops.into_iter().fold(Marks::NONE, Marks::union);
        self.steps += 1;
        if self.steps.is_multiple_of(HOP as u64) {
            self.hops.rotate_right(1);
            self.hops[0] = Marks::NONE;
        }
        window
    }

    /// Returns the index of the window that ends with the newest step; `None` if no window does.
    /// The index wraps.
    #[expect(clippy::cast_possible_truncation, reason = "the index wraps")]
    pub(crate) const fn complete_window(&self) -> Option<u32> {
        match self.steps.checked_sub(STEPS as u64) {
            Some(before) if before.is_multiple_of(HOP as u64) => Some((before / HOP as u64) as u32),
            _ => None,
        }
    }

    pub(crate) const fn steps(&self) -> u64 {
        self.steps
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    const OVERRUN: Marks = Marks { overrun: true, ..Marks::NONE };

    #[test]
    fn exactly_the_windows_that_contain_a_marked_step_are_marked() {
        for marked in 0..6 * HOP {
            let mut windows = WindowMarks::NONE;
            let mut found = Vec::new();
            for step in 0..10 * HOP {
                if step == marked {
                    windows.mark(OVERRUN);
                }
                let marks = windows.end_step();
                let ends = step + 1 >= STEPS && (step + 1 - STEPS).is_multiple_of(HOP);
                let window = ends.then(|| (step + 1 - STEPS) / HOP);
                let complete = windows.complete_window().map(|window| window as usize);
                assert_eq!(complete, window, "step {step}");
                found.extend(window.filter(|_| marks.overrun));
            }
            let containing = (0..10).filter(|window| {
                let first = window * HOP;
                (first..first + STEPS).contains(&marked)
            });
            assert_eq!(found, containing.collect::<Vec<_>>(), "step {marked}");
        }
    }
}
