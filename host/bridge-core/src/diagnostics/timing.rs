//! The device's report about its deadlines and stack, for `/diagnostics`.

use link::{StageTiming, Timing};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::diagnostics::status::new_status;

/// Returns the status `timing`. The message names the stages that missed a deadline since the
/// device's boot, and the stack if more than 3/4 of it was used. The values are the measurements of
/// all stages.
pub(crate) fn timing_status(timing: &Timing) -> DiagnosticStatus {
    let Timing {
        stages,
        stack_used,
        stack_size,
    } = timing;
    let late: Vec<String> = stages
        .iter()
        .filter(|stage| is_late(stage))
        .map(|stage| stage.stage.to_string())
        .collect();
    let stack = format!("{stack_used} of {stack_size} bytes");
    let stack_is_short = *stack_size > 0 && 4 * u64::from(*stack_used) > 3 * u64::from(*stack_size);
    let warnings: Vec<String> = [
        (!late.is_empty()).then(|| format!("late since boot: {}", late.join(" "))),
        stack_is_short.then(|| format!("stack nearly used up: {stack}")),
    ]
    .into_iter()
    .flatten()
    .collect();
    let state = if warnings.is_empty() {
        let message = format!("{} stages within their deadlines", stages.len());
        (DiagnosticLevel::Ok, message)
    } else {
        (DiagnosticLevel::Warn, warnings.join("; "))
    };
    let mut values: Vec<KeyValue> = stages.iter().flat_map(figures).collect();
    if *stack_size > 0 {
        values.push(KeyValue::new("stack", &stack));
    }
    new_status("timing", state, values)
}

/// Returns the stage with the largest ratio of worst time to deadline.
pub(crate) fn closest_to_deadline<'t>(
    stages: impl Iterator<Item = &'t StageTiming>,
) -> Option<StageTiming> {
    // Compare products instead of quotients: a/b > c/d if a*d > c*b.
    let product = |worst: &StageTiming, deadline: &StageTiming| {
        u64::from(worst.worst_ns) * u64::from(deadline.deadline_ns)
    };
    stages
        .max_by(|one, other| product(one, other).cmp(&product(other, one)))
        .copied()
}

/// Formats a stage's worst time together with its deadline, such as "worst 122.5 us of 1953 us".
pub(crate) fn worst_of_deadline(stage: &StageTiming) -> String {
    format!(
        "worst {} us of {} us",
        f64::from(stage.worst_ns) / 1000.0,
        f64::from(stage.deadline_ns) / 1000.0
    )
}

fn is_late(stage: &StageTiming) -> bool {
    stage.worst_ns > stage.deadline_ns
}

fn figures(stage: &StageTiming) -> [KeyValue; 2] {
    let name = stage.stage;
    let [within @ .., late] = stage.histogram;
    let within = within.map(|count| count.to_string()).join(" ");
    [
        KeyValue::new(&name.to_string(), &worst_of_deadline(stage)),
        KeyValue::new(
            &format!("{name}: times per eighth of it"),
            &format!("{within}, late {late}"),
        ),
    ]
}
