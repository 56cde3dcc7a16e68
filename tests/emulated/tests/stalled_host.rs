//! A host that stops reading for a third of the run: the board drops whole frames, the oldest first, and counts
//! each of them.
#![forbid(unsafe_code)]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use emulated::board::{APPLICATION, boards, or_panic};
use emulated::frames::Boot;
use emulated::host;
use emulated::input::{self, Input};
use emulator::pipes;
use link::{Code, Streams};
use serde_json::json;

const TEST: &str = "a host that stops reading";

/// Divisor of the number of samples: the host reads nothing during the first third of them. The
/// board's queue is full after three seconds.
const STALLED_PART: usize = 3;

#[test]
fn a_board_drops_whole_frames_and_counts_them_while_its_host_does_not_read() {
    let input = Input::from_environment();
    let expected = Boot::only(&host::sent(Streams::CODES, &input.samples)).codes();
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("stalled-host", &input.samples);
        // The samples arrive through a pipe, so the number that the board has read gives its
        // virtual time.
        let taken = Arc::new(AtomicUsize::new(0));
        let counter = Arc::clone(&taken);
        let samples = input.samples.clone().into_iter().map(move |sample| {
            counter.fetch_add(1, Relaxed);
            input::to_bytes(&[sample])
        });
        or_panic(pipes::feed(&scenario.folder.join(input::FILE), samples));
        let sent = or_panic(pipes::run(
            scenario.qemu(&["start"]),
            &scenario.folder,
            &[],
            scenario.silence,
            || taken.load(Relaxed) > input.samples.len() / STALLED_PART,
        ));
        let boot = Boot::only(&sent);
        let figures = json!({
            "frames": boot.frames,
            "frames_missing": boot.missing,
            "frames_dropped": boot.last_stats().frames_dropped,
            "codes": boot.timed_codes.len(),
            "different_codes": count_different(&boot, &expected),
        });
        board.record(&json!({"stalled_host": figures}));
        check(&boot, &expected);
    }
}

/// Counts the codes that differ from host-sim's code for the same window.
fn count_different(boot: &Boot, expected: &[Code]) -> usize {
    let is_different = |code: &&Code| expected.get(code.window as usize) != Some(*code);
    boot.codes().iter().filter(is_different).count()
}

fn check(boot: &Boot, expected: &[Code]) {
    let last = boot.last_stats();
    let dropped = last.frames_dropped;
    assert!(dropped > 0, "nothing was dropped: the port was not stuck");
    assert_eq!(boot.missing, dropped, "missing frames, dropped frames");
    assert_eq!(boot.damaged, 0, "damaged frames");
    assert_eq!(count_different(boot, expected), 0, "different codes");
    assert_eq!(last.overruns, 0, "overruns");
    let newest = boot.codes().last().map_or(0, |code| code.window as usize);
    let two_seconds = 2 * usize::from(model::STEP_RATE_HZ) / model::HOP;
    assert!(
        newest + two_seconds > expected.len(),
        "the newest code is {newest} of {}",
        expected.len()
    );
}

#[test]
fn a_stall_must_cost_frames_and_each_must_be_counted() {
    let sent = host::sent(Streams::CODES, &Input::new(80).samples);
    let expected = Boot::only(&sent).codes();
    let dropping = |counted, missing| {
        let mut boot = Boot::only(&sent);
        boot.missing = missing;
        boot.stats.last_mut().expect("counters").frames_dropped = counted;
        boot
    };
    let refuses = |words, boot: &Boot| {
        emulated::refusal::assert_refused(words, || check(boot, &expected));
    };
    check(&dropping(3, 3), &expected);
    refuses("the port was not stuck", &Boot::only(&sent));
    refuses("left: 4\n right: 3", &dropping(3, 4));
    let mut old = dropping(3, 3);
    old.timed_codes.truncate(20);
    refuses("the newest code is 19 of 80", &old);
    let mut wrong = dropping(3, 3);
    wrong.timed_codes[5].1.window += 1;
    refuses("different codes\n  left: 1", &wrong);
}
