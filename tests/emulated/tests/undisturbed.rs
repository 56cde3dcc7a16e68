//! An undisturbed run sends host-sim's codes, and a second run sends the same bytes.
#![forbid(unsafe_code)]

use emulated::board::{APPLICATION, Run, boards};
use emulated::compare::count_differences;
use emulated::frames::{Boot, Hello, without_timing};
use emulated::host;
use emulated::input::Input;
use emulated::stages::{self, Stages};
use emulator::{figures, skip};
use link::{ResetCause, Streams};
use serde_json::json;

const TEST: &str = "codes of the emulated application";

#[test]
fn codes_are_host_sims_and_a_second_run_repeats_them() {
    let input = Input::from_environment();
    for source in &input.skipped {
        skip::skipped(TEST, source);
    }
    let sources = json!({"inputs": input.names, "skipped": input.skipped});
    figures::record(None, &sources);
    let samples = input.samples.len();
    let expected = Boot::only(&host::sent(Streams::CODES, &input.samples));
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("undisturbed", &input.samples);
        let runs = scenario.run_twice(&["start"]);
        let [first, second] = &runs;
        let boot = Boot::only(&first.sent);
        let stages = Stages::from_last(&boot.timing);
        board.record(&json!({
            "core": board.machine.core,
            "codes": boot.timed_codes.len(),
            // Counts codes that differ in any field, and missing codes.
            "different_codes": count_differences(&expected.codes(), &boot.codes()),
            "different_reports": count_differences(&expected.quality, &boot.quality),
            "repeatable": is_repeated(&runs),
            // Measured times differ on a busy PC, presumably because QEMU's main loop is a separate
            // thread: an interrupt of the UART then occurs some instructions earlier or later.
            "times_repeat": first.sent == second.sent,
            "samples": first.printed("samples"),
            "overruns": first.overruns(&boot).max(second.printed("overruns")),
            "frames_dropped": boot.last_stats().frames_dropped,
            "frames": boot.frames,
            "frames_missing": boot.missing,
            "frames_damaged": boot.damaged,
            "bytes": first.sent.len(),
            "jitter_us": boot.jitter_us(),
            "wall_seconds": first.wall.max(second.wall).as_secs_f64(),
            "stages": stages,
        }));
        check(&runs, &boot, &expected, samples);
        check_reports(&boot, samples);
        stages.assert_within(stages::LIMIT);
    }
}

/// Returns whether both runs have sent the same bytes, except for measured times, and have printed
/// the same lines.
fn is_repeated([first, second]: &[Run; 2]) -> bool {
    without_timing(&first.sent) == without_timing(&second.sent) && first.lines == second.lines
}

/// Checks everything in a run that host-sim sends, too.
fn check(runs: &[Run; 2], boot: &Boot, expected: &Boot, samples: usize) {
    for run in runs {
        run.assert_complete(boot, samples);
    }
    assert!(is_repeated(runs), "a second run has sent other bytes");
    assert_eq!(boot.jitter_us(), 0, "jitter_us");
    boot.assert_equal_outputs(expected);
    assert_eq!(boot.capabilities, expected.capabilities, "capabilities");
}

/// Checks the name of the board, and that its counters arrive every second; host-sim's reports
/// differ.
fn check_reports(boot: &Boot, samples: usize) {
    let hello = Hello {
        board: "qemu-mps2".to_owned(),
        model_id: model::MODEL_ID,
        cause: ResetCause::PowerOn,
        fault: String::new(),
    };
    assert_eq!(boot.hellos, [hello]);
    assert_eq!(boot.stats.len(), boot.quality.len(), "Stats and Quality");
    let last = boot.last_stats();
    assert!(last.samples <= samples as u64, "the last Stats: {last:?}");
}

#[test]
fn unequal_unrepeatable_overrun_and_lost_data_are_refused() {
    let input = Input::new(40);
    let samples = input.samples.len();
    let run = Run {
        sent: host::sent(Streams::CODES, &input.samples),
        lines: vec![format!("samples {samples}"), "overruns 0".to_owned()],
        wall: std::time::Duration::ZERO,
    };
    let expected = Boot::only(&run.sent);
    let check = |runs: [Run; 2]| {
        let boot = Boot::only(&runs[0].sent);
        check(&runs, &boot, &expected, samples);
    };
    let changed = |change: &dyn Fn(&mut Run)| {
        let mut run = run.clone();
        change(&mut run);
        run
    };
    let refuses_second = |words, change: &dyn Fn(&mut Run)| {
        emulated::refusal::assert_refused(words, || check([run.clone(), changed(change)]));
    };
    let refuses_both = |words, change: &dyn Fn(&mut Run)| {
        emulated::refusal::assert_refused(words, || check([changed(change), changed(change)]));
    };
    check([run.clone(), run.clone()]);
    refuses_second("overruns\n  left: 2", &|run| {
        run.lines[1] = "overruns 2".to_owned();
    });
    refuses_second("a second run has sent other bytes", &|run| {
        run.sent.truncate(1_000);
    });
    refuses_both("printed no `samples`", &|run| run.lines.clear());
    refuses_both("samples\n  left: 9", &|run| {
        run.lines[0] = "samples 9".to_owned();
    });
    // Changes a byte within the first code: the frame is damaged, and its sequence number is
    // missing.
    refuses_both("left: (0, 1, 1)", &|run| run.sent[1_600] ^= 0x10);

    let mut boot = expected.clone();
    boot.timed_codes[7].1.first_sample += 1;
    emulated::refusal::assert_refused("window 7 differs in first sample", || {
        boot.assert_equal_outputs(&expected);
    });
}
