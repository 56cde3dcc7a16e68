//! An undisturbed run sends host-sim's codes, and a second run sends the same bytes.
#![forbid(unsafe_code)]

use emulated::board::{APPLICATION, Board, Run, boards};
use emulated::compare::count_differences;
use emulated::frames::{Boot, Hello, without_timing};
use emulated::host;
use emulated::input::Input;
use emulated::stages::{self, Stages};
use emulator::{figures, skip};
use link::{ResetCause, Streams};
use serde::Serialize;
use serde_json::json;

const TEST: &str = "codes of the emulated application";

/// Figures of one machine.
#[derive(Debug, Serialize)]
struct Figures {
    core: &'static str,
    codes: usize,
    /// Codes that differ from host-sim's in values, window, first sample or flags, and missing ones.
    different_codes: usize,
    /// Reports on the electrodes that are not host-sim's.
    different_reports: usize,
    /// Whether the second run has sent the same bytes, but for measured times.
    repeatable: bool,
    /// Whether the measured times are the same, too. They are not always on a busy PC, presumably because QEMU's
    /// main loop is a thread of its own: an interrupt of the UART then comes some instructions sooner or later.
    times_repeat: bool,
    samples: u64,
    overruns: u64,
    frames_dropped: u32,
    frames: u32,
    frames_missing: u32,
    frames_damaged: u32,
    bytes: usize,
    jitter_us: u64,
    /// Duration of the slower run on this PC.
    wall_seconds: f64,
    stages: Stages,
}

#[test]
fn codes_are_host_sims_and_a_second_run_repeats_them() {
    let input = Input::from_environment();
    for source in &input.skipped {
        skip::skipped(TEST, source);
    }
    figures::record(
        None,
        &json!({"inputs": input.names, "skipped": input.skipped}),
    );
    let expected = Boot::only(&host::sent(Streams::CODES, &input.samples));
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("undisturbed", &input.samples);
        let runs = scenario.run_twice(&["start"]);
        let boot = Boot::only(&runs[0].sent);
        let figures = figures(&board, &runs, &boot, &expected);
        figures::record(Some(board.machine.name), &figures);
        check_stream(&runs, &boot, &expected, input.samples.len());
        check_board(&boot, input.samples.len());
        figures.stages.assert_within(stages::LIMIT);
    }
}

fn figures(board: &Board, runs: &[Run; 2], boot: &Boot, expected: &Boot) -> Figures {
    let [first, second] = runs;
    let last = boot.last_stats();
    let overruns = [first, second].map(|run| run.printed("overruns"));
    Figures {
        core: board.machine.core,
        codes: boot.timed_codes.len(),
        different_codes: count_differences(&expected.codes(), &boot.codes()),
        different_reports: count_differences(&expected.quality, &boot.quality),
        repeatable: without_timing(&first.sent) == without_timing(&second.sent)
            && first.lines == second.lines,
        times_repeat: first.sent == second.sent,
        samples: first.printed("samples"),
        overruns: overruns[0].max(overruns[1]).max(last.overruns.into()),
        frames_dropped: last.frames_dropped,
        frames: boot.frames,
        frames_missing: boot.missing,
        frames_damaged: boot.damaged,
        bytes: first.sent.len(),
        jitter_us: boot.jitter_us(),
        wall_seconds: first.wall.max(second.wall).as_secs_f64(),
        stages: Stages::from_last(&boot.timing),
    }
}

/// Checks what a board and host-sim have in common.
fn check_stream(runs: &[Run; 2], boot: &Boot, expected: &Boot, samples: usize) {
    let [first, second] = runs;
    for run in runs {
        assert_eq!(run.printed("samples"), samples as u64, "samples");
        assert_eq!(run.printed("overruns"), 0, "overruns");
    }
    assert!(
        without_timing(&first.sent) == without_timing(&second.sent),
        "repeatable: a second run has sent other bytes"
    );
    assert_eq!(first.lines, second.lines, "repeatable: printed lines");
    boot.assert_whole();
    assert_eq!(boot.jitter_us(), 0, "jitter_us");
    boot.assert_codes(&expected.codes());
    assert_eq!(
        count_differences(&expected.quality, &boot.quality),
        0,
        "reports on electrodes that are not host-sim's"
    );
    assert_eq!(
        boot.capabilities, expected.capabilities,
        "the capabilities are not host-sim's"
    );
    assert_eq!(boot.last_stats().overruns, 0, "overruns in Stats");
}

/// Checks what only a board reports: its name, and its counters every second.
fn check_board(boot: &Boot, samples: usize) {
    let hello = Hello {
        board: "qemu-mps2".to_owned(),
        model_id: model::MODEL_ID,
        cause: ResetCause::PowerOn,
        fault: String::new(),
    };
    assert_eq!(boot.hellos, [hello]);
    let last = boot.last_stats();
    assert!(
        boot.stats.len() == boot.quality.len() && last.samples <= samples as u64,
        "{} Stats for {} reports; the last: {last:?}",
        boot.stats.len(),
        boot.quality.len()
    );
}

mod checks {
    use std::time::Duration;

    use emulated::refusal;

    use super::*;

    /// Why a board is refused that sends what host-sim does, after `change`.
    fn refusal(change: impl Fn(&mut Run)) -> String {
        refusal_of_pair(|[first, second]| {
            change(first);
            change(second);
        })
    }

    fn refusal_of_pair(change: impl Fn(&mut [Run; 2])) -> String {
        let input = Input::new(40);
        let samples = input.samples.len();
        let run = Run {
            sent: host::sent(Streams::CODES, &input.samples),
            lines: vec![format!("samples {samples}"), "overruns 0".to_owned()],
            wall: Duration::from_secs(1),
        };
        let expected = Boot::only(&run.sent);
        let mut runs = [run.clone(), run];
        change(&mut runs);
        let boot = Boot::only(&runs[0].sent);
        refusal::message(|| check_stream(&runs, &boot, &expected, samples))
    }

    #[test]
    fn unequal_unrepeatable_overrun_and_lost_data_are_refused() {
        assert_eq!(refusal(|_| ()), "");
        let overrun = refusal_of_pair(|runs| runs[1].lines[1] = "overruns 2".to_owned());
        assert!(overrun.contains("overruns\n  left: 2"), "{overrun}");
        let other = refusal_of_pair(|runs| runs[1].sent.truncate(1_000));
        assert_eq!(other, "repeatable: a second run has sent other bytes");
        let silent = refusal(|run| run.lines.clear());
        assert!(silent.contains("printed no `samples`"), "{silent}");
        let short = refusal(|run| run.lines[0] = "samples 9".to_owned());
        assert!(short.contains("samples\n  left: 9"), "{short}");
        // A byte within the first code: the frame is damaged, and so a number is missing.
        let damaged = refusal(|run| run.sent[1_600] ^= 0x10);
        assert!(damaged.contains("left: (0, 1, 1)"), "{damaged}");
    }

    #[test]
    fn a_code_that_is_not_host_sims_is_refused() {
        let sent = host::sent(Streams::CODES, &Input::new(40).samples);
        let expected = Boot::only(&sent);
        let mut boot = expected.clone();
        boot.timed_codes[7].1.first_sample += 1;
        let wrong = refusal::message(|| boot.assert_codes(&expected.codes()));
        assert!(
            wrong.ends_with("window 7 differs in first sample"),
            "{wrong}"
        );
    }
}
