//! What goes wrong outside the pipeline.

use link::Flags;
use model::{HOP, STEPS};

/// What went wrong around a sample or a window, outside the pipeline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Marks {
    /// A status word of the ADC chain was wrong.
    pub adc_status_bad: bool,
    /// The ADC reported an electrode off.
    pub lead_off: bool,
    /// A sample was not read in time.
    pub overrun: bool,
}

impl Marks {
    /// Nothing went wrong.
    pub const NONE: Self = Self {
        adc_status_bad: false,
        lead_off: false,
        overrun: false,
    };

    /// What went wrong in one or the other.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self {
            adc_status_bad: self.adc_status_bad | other.adc_status_bad,
            lead_off: self.lead_off | other.lead_off,
            overrun: self.overrun | other.overrun,
        }
    }

    /// As they go over the wire.
    pub(crate) fn flags(self) -> Flags {
        [
            (self.adc_status_bad, Flags::ADC_STATUS_BAD),
            (self.lead_off, Flags::LEAD_OFF),
            (self.overrun, Flags::OVERRUN),
        ]
        .into_iter()
        .filter(|(set, _)| *set)
        .fold(Flags::empty(), |flags, (_, flag)| flags | flag)
    }
}

/// What went wrong in the windows that are open.
#[derive(Clone, Debug)]
pub(crate) struct WindowMarks {
    /// Steps since the start.
    steps: u64,
    /// Of the last hops, the newest first.
    hops: [Marks; STEPS.div_ceil(HOP)],
}

impl WindowMarks {
    /// Before the first step.
    pub(crate) const NONE: Self = Self {
        steps: 0,
        hops: [Marks::NONE; STEPS.div_ceil(HOP)],
    };

    /// Something went wrong since the last step.
    pub(crate) fn mark(&mut self, marks: Marks) {
        self.hops[0] = self.hops[0].or(marks);
    }

    /// A step is through; gives what went wrong in the window that ends with it.
    pub(crate) fn step(&mut self) -> Marks {
        let window = self.hops.into_iter().fold(Marks::NONE, Marks::or);
        self.steps += 1;
        if self.steps.is_multiple_of(HOP as u64) {
            self.hops.rotate_right(1);
            self.hops[0] = Marks::NONE;
        }
        window
    }

    /// Steps since the start.
    pub(crate) const fn steps(&self) -> u64 {
        self.steps
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    const OVERRUN: Marks = Marks {
        overrun: true,
        ..Marks::NONE
    };

    #[test]
    fn the_windows_that_contain_a_marked_step_are_marked_and_no_others() {
        for marked in 0..6 * HOP {
            let mut windows = WindowMarks::NONE;
            let mut found = Vec::new();
            for step in 0..10 * HOP {
                if step == marked {
                    windows.mark(OVERRUN);
                }
                let marks = windows.step();
                if step + 1 >= STEPS && (step + 1 - STEPS).is_multiple_of(HOP) && marks.overrun {
                    found.push((step + 1 - STEPS) / HOP);
                }
            }
            let containing = (0..10).filter(|window| {
                let first = window * HOP;
                (first..first + STEPS).contains(&marked)
            });
            assert_eq!(found, containing.collect::<Vec<_>>(), "step {marked}");
        }
    }
}
