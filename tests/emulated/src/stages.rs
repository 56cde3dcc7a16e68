//! Worst times of the stages of an emulated board, in virtual time, and their limits.

use std::fmt;

use link::Timing;
use serde::Serialize;

use crate::board::INSTRUCTION_SHIFT;

/// Largest part of its deadline that a stage may take while only codes stream. The Cortex-M4F takes
/// at most 0.43 and the Cortex-M7 at most 0.49; the rest is room for the emulator, whose times
/// differ by some microseconds when the PC is busy.
pub const LIMIT: f64 = 0.55;

/// Largest part of its deadline that a stage may take while a board sends all streams, or receives
/// a hundred commands a second. The worst measured parts are 0.75 and 0.82, for a step with which
/// samples, filtered steps, an audit, a report and a code are sent at once.
pub const LIMIT_BUSY: f64 = 0.9;

/// Largest part of the stack that may have been used.
const STACK_LIMIT: f64 = 0.75;

/// Worst times of the stages that a board has reported; they include other tasks and interrupts.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Stages {
    #[serde(rename = "stages")]
    each: Vec<Stage>,
    /// Bytes of the stack that have been used since the boot.
    stack_used: u32,
    /// Size of the stack in bytes.
    stack_size: u32,
}

#[derive(Debug, Clone, Serialize)]
struct Stage {
    name: String,
    worst_ns: u32,
    deadline_ns: u32,
    /// `worst_ns` in instructions. It includes the instructions of other tasks and of interrupts,
    /// and also idle time, because `send` waits for the UART. The board's clock ticks every 2.5
    /// instructions.
    worst_instructions: u32,
    /// `deadline_ns` in instructions, at 62.5 million a second.
    deadline_instructions: u32,
    /// Number of times that the stage missed its deadline.
    late: u32,
}

impl Stages {
    /// Returns the times from the last `Timing` of a boot, which covers the whole boot; empty
    /// without one.
    pub fn from_last(timing: &[Timing]) -> Self {
        let Some(timing) = timing.last() else {
            return Self::default();
        };
        let stages = timing.stages.iter().map(|stage| Stage {
            name: stage.stage.to_string(),
            worst_ns: stage.worst_ns,
            deadline_ns: stage.deadline_ns,
            worst_instructions: stage.worst_ns >> INSTRUCTION_SHIFT,
            deadline_instructions: stage.deadline_ns >> INSTRUCTION_SHIFT,
            late: stage.histogram[stage.histogram.len() - 1],
        });
        Self {
            each: stages.collect(),
            stack_used: timing.stack_used,
            stack_size: timing.stack_size,
        }
    }

    /// Checks that each stage took at most the part `limit` of its deadline, and the stack at most its own limit.
    ///
    /// # Panics
    /// When a stage or the stack is above its limit, or when the board has reported no times.
    pub fn assert_within(&self, limit: f64) {
        assert!(
            !self.each.is_empty(),
            "the board has not reported how long its stages take"
        );
        for stage in &self.each {
            assert!(
                stage.over_deadline() <= limit && stage.late == 0,
                "{stage}: more than {limit} of its deadline, or late {} times",
                stage.late
            );
        }
        let (used, size) = (self.stack_used, self.stack_size);
        assert!(
            size > 0 && f64::from(used) <= STACK_LIMIT * f64::from(size),
            "{used} of {size} bytes of stack were used"
        );
    }
}

impl Stage {
    fn over_deadline(&self) -> f64 {
        f64::from(self.worst_ns) / f64::from(self.deadline_ns)
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [worst, deadline] = [self.worst_ns, self.deadline_ns].map(|ns| ns / 1_000);
        write!(
            f,
            "{} {worst} of {deadline} us ({} of {} instructions)",
            self.name, self.worst_instructions, self.deadline_instructions
        )
    }
}

#[cfg(test)]
mod tests {
    use link::StageTiming;

    use super::*;
    use crate::refusal;

    fn timing(worst_ns: u32, late: u32) -> Timing {
        let mut histogram = [1; 9];
        histogram[8] = late;
        Timing {
            stages: [StageTiming {
                stage: link::Stage::Step,
                deadline_ns: 8_000_000,
                worst_ns,
                histogram,
            }]
            .into_iter()
            .collect(),
            stack_used: 600,
            stack_size: 1_000,
        }
    }

    #[test]
    fn a_stage_near_its_deadline_a_deep_stack_and_silence_are_refused() {
        let check = |timing: &[Timing], limit| Stages::from_last(timing).assert_within(limit);
        let refuses = |words, timing: &[Timing], limit| {
            refusal::assert_refused(words, || check(timing, limit));
        };
        check(&[timing(2_000_000, 0)], LIMIT);
        check(&[timing(4_400_000, 0)], LIMIT);
        let words = "step 4400 of 8000 us (275000 of 500000 instructions): more than 0.55";
        refuses(words, &[timing(4_400_001, 0)], LIMIT);
        refuses("or late 1 times", &[timing(1, 1)], LIMIT);
        check(&[timing(7_200_000, 0)], LIMIT_BUSY);
        refuses("more than 0.9 of", &[timing(7_200_001, 0)], LIMIT_BUSY);
        refuses("or late 1 times", &[timing(1, 1)], LIMIT_BUSY);
        let mut deep = timing(1, 0);
        deep.stack_used = 900;
        refuses("900 of 1000 bytes of stack", &[deep], LIMIT);
        refuses("has not reported", &[], LIMIT);
    }
}
