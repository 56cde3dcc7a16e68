//! How long the stages of an emulated board take.

use std::fmt;

use link::Timing;
use serde::Serialize;

use super::INSTRUCTION_NS;

/// Most that any stage may take of its deadline. Half of it is what the Cortex-M4F and M7 stay below
/// (0.43 and 0.49); the rest is room for the emulator, whose times differ by some microseconds when the PC
/// is busy.
const MOST: f64 = 0.55;
/// The same where a board sends all that it has, or is given a hundred commands a second: the worst seen are
/// 0.75 and 0.82, of a step with which samples, filtered steps, an audit, a report and a code go out at
/// once.
const MOST_BUSY: f64 = 0.9;
/// Most of the stack that may have been used.
const MOST_STACK: f64 = 0.75;

/// What a board says of its stages at last: in virtual time, other tasks and interrupts included.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Stages {
    #[serde(rename = "stages")]
    each: Vec<Stage>,
    /// Bytes.
    stack_used: u32,
    stack_size: u32,
}

#[derive(Debug, Clone, Serialize)]
struct Stage {
    name: String,
    worst_ns: u32,
    deadline_ns: u32,
    /// The worst case in instructions, those of other tasks and of interrupts included, and as many as an
    /// idle core would have done meanwhile: `send` waits for the UART. Simulated; the clock's ticks are 2.5
    /// instructions.
    worst_instructions: u32,
    /// Instructions until the deadline, at 62.5 million a second.
    deadline_instructions: u32,
    /// How often it was late.
    late: u32,
}

impl Stages {
    /// Of the last report, which counts from the start.
    pub(super) fn of(timing: Option<&Timing>) -> Self {
        let Some(timing) = timing else {
            return Self::default();
        };
        let stages = timing.stages.iter().map(|stage| Stage {
            name: stage.stage.to_string(),
            worst_ns: stage.worst_ns,
            deadline_ns: stage.deadline_ns,
            worst_instructions: stage.worst_ns / INSTRUCTION_NS,
            deadline_instructions: stage.deadline_ns / INSTRUCTION_NS,
            late: stage.histogram[stage.histogram.len() - 1],
        });
        Self {
            each: stages.collect(),
            stack_used: timing.stack_used,
            stack_size: timing.stack_size,
        }
    }

    /// The worst stage over its deadline; none where nothing was said.
    pub(super) fn worst_over_deadline(&self) -> Option<f64> {
        self.each.iter().map(Stage::over_deadline).reduce(f64::max)
    }

    pub(super) fn faults(&self) -> Vec<String> {
        self.faults_above(MOST)
    }

    /// Of a board that is kept busy.
    pub(super) fn faults_when_busy(&self) -> Vec<String> {
        self.faults_above(MOST_BUSY)
    }

    fn faults_above(&self, most: f64) -> Vec<String> {
        let mut faults: Vec<String> = self
            .each
            .iter()
            .filter(|stage| stage.over_deadline() > most || stage.late > 0)
            .map(|stage| format!("{stage}: more than {most} of its deadline, or late"))
            .collect();
        if self.each.is_empty() {
            faults.push("it has not said how long its stages take".to_owned());
        }
        let stack = f64::from(self.stack_used) / f64::from(self.stack_size);
        // What is no number is no measurement.
        if stack.is_nan() || stack > MOST_STACK {
            let (used, size) = (self.stack_used, self.stack_size);
            faults.push(format!("{used} of {size} bytes of stack were used"));
        }
        faults
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

impl fmt::Display for Stages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stages: Vec<String> = self.each.iter().map(Stage::to_string).collect();
        write!(
            f,
            "worst, simulated: {}; stack {} of {} bytes",
            stages.join(", "),
            self.stack_used,
            self.stack_size
        )
    }
}

#[cfg(test)]
mod tests {
    use link::StageTiming;

    use super::*;

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
    fn an_instruction_lasts_as_long_as_qemu_is_told() {
        let shift = super::super::VIRTUAL_TIME.strip_prefix("shift=");
        let shift = shift.and_then(|rest| rest.split(',').next()?.parse::<u32>().ok());
        assert_eq!(shift.map(|shift| 1 << shift), Some(INSTRUCTION_NS));
    }

    #[test]
    fn a_stage_near_its_deadline_a_deep_stack_and_silence_are_faults() {
        let sound = Stages::of(Some(&timing(2_000_000, 0)));
        assert_eq!(sound.worst_over_deadline(), Some(0.25));
        assert!(sound.faults().is_empty());
        assert!(
            sound
                .to_string()
                .contains("step 2000 of 8000 us (125000 of 500000 instructions)"),
            "{sound}"
        );
        assert_eq!(Stages::of(Some(&timing(4_400_001, 0))).faults().len(), 1);
        assert_eq!(Stages::of(Some(&timing(1, 1))).faults().len(), 1);
        let busy = |worst, late| Stages::of(Some(&timing(worst, late))).faults_when_busy();
        assert!(busy(4_400_001, 0).is_empty());
        assert_eq!([busy(7_200_001, 0).len(), busy(1, 1).len()], [1, 1]);
        let mut deep = timing(1, 0);
        deep.stack_used = 900;
        assert_eq!(Stages::of(Some(&deep)).faults().len(), 1);
        assert_eq!(Stages::of(None).faults().len(), 2);
        assert_eq!(Stages::of(None).worst_over_deadline(), None);
    }
}
