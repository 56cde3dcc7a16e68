//! Longest times of the pipeline's stages on an emulated board, and their limits.

use link::{StageTiming, Timing};
use serde_json::{Value, json};

use crate::board::INSTRUCTION_SHIFT;

/// Largest permitted time of a stage, as a fraction of its deadline, while only codes are streamed.
/// The largest measured fractions are 0.43 on the Cortex-M4F and 0.49 on the Cortex-M7. The margin
/// is for the emulator, whose times vary by some microseconds when the PC is busy.
pub const LIMIT: f64 = 0.55;

/// Largest permitted time of a stage, as a fraction of its deadline, while a board sends all
/// streams or receives a hundred commands a second. The largest measured fractions are 0.75 on the
/// Cortex-M4F and 0.82 on the Cortex-M7, for a step after which samples, filtered steps, an audit,
/// a report and a code are sent at once.
pub const LIMIT_BUSY: f64 = 0.9;

/// Largest permitted use of the stack, as a fraction of its size.
const STACK_LIMIT: f64 = 0.75;

/// Returns the figures in a `Timing`: for each stage its longest time and its deadline, in
/// nanoseconds and in instructions, and how often it was late; then the stack's use and size, in
/// bytes.
///
/// A longest time includes other tasks and interrupts, and for `send` also the wait for the UART.
/// The board's clock ticks every 2.5 instructions.
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

/// Returns how often a stage missed its deadline, which the last bin of its histogram counts.
fn late(stage: &StageTiming) -> u32 {
    stage.histogram[stage.histogram.len() - 1]
}

/// Checks that no stage took more than the fraction `limit` of its deadline, and that at most three
/// quarters of the stack were used.
///
/// # Panics
/// When a limit was exceeded, a stage was late, or the board has reported no times.
pub fn assert_within(limit: f64, timing: &Timing) {
    assert!(!timing.stages.is_empty(), "the board has not reported how long its stages take");
    for stage in &timing.stages {
        let part = f64::from(stage.worst_ns) / f64::from(stage.deadline_ns);
        assert!(part <= limit, "{part} of its deadline, at most {limit} expected: {stage:?}");
        assert_eq!(late(stage), 0, "times late: {stage:?}");
    }
    let (used, size) = (timing.stack_used, timing.stack_size);
    let part = f64::from(used) / f64::from(size);
    assert!(part <= STACK_LIMIT, "{used} of {size} bytes of stack were used");
}
