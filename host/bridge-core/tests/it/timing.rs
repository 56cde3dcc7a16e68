//! The status `timing` in `/diagnostics`, and the worst stage in the summary.

use link::{Stage, StageTiming, Timing, ToHost};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus};

use crate::board::Board;
use crate::recorder::{Harness, SETTINGS, state};

const ACQUIRE: StageTiming = StageTiming {
    stage: Stage::Acquire,
    deadline_ns: 1_953_125,
    worst_ns: 122_500,
    histogram: [512, 0, 0, 0, 0, 0, 0, 0, 0],
};

/// A stage that exactly meets its deadline, and is closer to it than `ACQUIRE`.
const CODE: StageTiming = StageTiming {
    stage: Stage::Code,
    deadline_ns: 7_812_500,
    worst_ns: 7_812_500,
    histogram: [0, 9, 0, 0, 0, 0, 0, 1, 0],
};

/// Returns a report about two stages that met their deadlines and a stack of which 3/4 was used,
/// the limit without a warning. `change` modifies the report.
fn report(change: impl FnOnce(&mut Timing)) -> ToHost<'static> {
    let mut timing = Timing {
        stages: [ACQUIRE, CODE].into_iter().collect(),
        stack_used: 6144,
        stack_size: 8192,
    };
    change(&mut timing);
    ToHost::Timing(timing)
}

fn values(status: &DiagnosticStatus) -> Vec<(&str, &str)> {
    let values = status.values.iter();
    values.map(|pair| (&*pair.key, &*pair.value)).collect()
}

#[test]
fn stages_in_time_and_a_sufficient_stack_are_no_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = harness.status_after(&report(|_| {}), "timing").unwrap();
    assert_eq!(
        state(&status),
        (DiagnosticLevel::Ok, "2 stages within their deadlines")
    );
    assert!(status.hardware_id.starts_with("board "));
    assert_eq!(
        values(&status),
        [
            ("acquire", "worst 122.5 us of 1953.125 us"),
            (
                "acquire: times per eighth of it",
                "512 0 0 0 0 0 0 0, late 0"
            ),
            ("code", "worst 7812.5 us of 7812.5 us"),
            ("code: times per eighth of it", "0 9 0 0 0 0 0 1, late 0"),
            ("stack", "6144 of 8192 bytes"),
        ]
    );
}

#[test]
fn a_stage_that_was_late_by_a_nanosecond_is_named() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let message = report(|timing| {
        timing.stages[1].worst_ns += 1;
        timing.stages[1].histogram[8] = 1;
        let newer = StageTiming {
            stage: Stage::Newer(9),
            deadline_ns: 1_000,
            worst_ns: 5_000,
            histogram: [0, 0, 0, 0, 0, 0, 0, 0, 3],
        };
        timing.stages.push(newer).unwrap();
    });
    let status = harness.status_after(&message, "timing").unwrap();
    assert_eq!(
        state(&status),
        (DiagnosticLevel::Warn, "late since boot: code stage 9")
    );
    assert!(values(&status).contains(&("stage 9", "worst 5 us of 1 us")));
    assert!(
        values(&status).contains(&("stage 9: times per eighth of it", "0 0 0 0 0 0 0 0, late 3"))
    );
}

#[test]
fn more_than_three_quarters_of_the_stack_is_a_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = harness
        .status_after(&report(|timing| timing.stack_used += 1), "timing")
        .unwrap();
    assert_eq!(
        state(&status),
        (
            DiagnosticLevel::Warn,
            "stack nearly used up: 6145 of 8192 bytes"
        )
    );
    let message = report(|timing| {
        timing.stages[0].worst_ns = u32::MAX;
        timing.stack_used = u32::MAX;
    });
    let status = harness.status_after(&message, "timing").unwrap();
    assert_eq!(
        status.message,
        "late since boot: acquire; stack nearly used up: 4294967295 of 8192 bytes"
    );
}

#[test]
fn a_device_that_measures_nothing_is_no_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = harness
        .status_after(&ToHost::Timing(Timing::default()), "timing")
        .unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
    assert!(status.values.is_empty(), "{status:?}");
    assert_eq!(harness.core.summary().worst_stage, None);
    assert!(!harness.core.summary().to_string().contains("stage"));
}

#[test]
fn the_newest_report_of_deadlines_is_shown_once() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    assert_eq!(harness.status("timing"), None);
    let older = report(|timing| timing.stack_used = 8192);
    harness.send(0, &older);
    let status = harness.status_after(&report(|_| {}), "timing").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
    assert_eq!(harness.status("timing"), None);
}

#[test]
fn a_report_of_deadlines_from_before_a_reset_is_discarded() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.send(0, &report(|_| {}));
    harness.board.reboot();
    let hello = harness.board.hello();
    harness.receive(&hello);
    assert_eq!(harness.status("timing"), None);
}

#[test]
fn the_summary_names_the_stage_closest_to_its_deadline_across_resets() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.status_after(&report(|timing| timing.stages[0].worst_ns *= 2), "timing");
    assert_eq!(harness.core.summary().worst_stage, Some(CODE));
    let late = report(|timing| timing.stages[0].worst_ns = 4_000_000);
    harness.status_after(&late, "timing");
    harness.board.reboot();
    let hello = harness.board.hello();
    harness.receive(&hello);
    harness.status_after(&report(|_| {}), "timing");
    let line = harness.core.summary().to_string();
    assert!(
        line.ends_with("; stage acquire: worst 4000 us of 1953.125 us"),
        "{line}"
    );
}
