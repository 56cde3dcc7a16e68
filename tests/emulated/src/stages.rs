//! Worst times of the stages of an emulated board, in virtual time, and their limits.

use link::{StageTiming, Timing};
use serde_json::{Value, json};

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

/// Figures of a boot's last `Timing`: for each stage its worst time, in nanoseconds and in instructions, its
/// deadline, and how often it was late; bytes of the stack.
///
/// A worst time includes other tasks and interrupts, and that of `send` also idle time, because it waits for the
/// UART. The board's clock ticks every 2.5 instructions.
pub fn figures(timing: &Timing) -> Value {
    let stage = |stage: &StageTiming| {
        json!({
            "name": stage.stage.to_string(),
            "worst_ns": stage.worst_ns,
            "deadline_ns": stage.deadline_ns,
            "worst_instructions": stage.worst_ns >> INSTRUCTION_SHIFT,
            "deadline_instructions": stage.deadline_ns >> INSTRUCTION_SHIFT,
            "late": late(stage),
        })
    };
    json!({
        "stages": timing.stages.iter().map(stage).collect::<Vec<_>>(),
        "stack_used": timing.stack_used,
        "stack_size": timing.stack_size,
    })
}

/// Number of times that a stage missed its deadline.
fn late(stage: &StageTiming) -> u32 {
    stage.histogram[stage.histogram.len() - 1]
}

/// Checks that each stage took at most the part `limit` of its deadline, and the stack at most its own limit.
///
/// # Panics
/// When a stage is above its limit or was late, when the stack is above its limit, or when the board has reported no
/// times.
pub fn assert_within(limit: f64, timing: &Timing) {
    assert!(
        !timing.stages.is_empty(),
        "the board has not reported how long its stages take"
    );
    for stage in &timing.stages {
        let part = f64::from(stage.worst_ns) / f64::from(stage.deadline_ns);
        assert!(
            part <= limit,
            "{part} of its deadline, at most {limit} expected: {stage:?}"
        );
        assert_eq!(late(stage), 0, "times late: {stage:?}");
    }
    let (used, size) = (timing.stack_used, timing.stack_size);
    let part = f64::from(used) / f64::from(size);
    assert!(
        part <= STACK_LIMIT,
        "{used} of {size} bytes of stack were used"
    );
}
