//! A host that stops reading for a third of the run: the board drops whole frames, the oldest first, and counts
//! each of them.
#![forbid(unsafe_code)]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use emulated::board::{APPLICATION, boards, or_panic};
use emulated::frames::Boot;
use emulated::host;
use emulated::input::{self, Input};
use emulator::{figures, pipes};
use link::{Code, Streams};
use serde::Serialize;
use serde_json::json;

const TEST: &str = "a host that stops reading";

/// Part of the samples after which the host starts to read. The board's queue is full after three seconds.
const STALLED: usize = 3;

/// Figures of one machine.
#[derive(Debug, Serialize)]
struct Figures {
    frames: u32,
    frames_missing: u32,
    /// Frames that the board reports as dropped.
    frames_dropped: u32,
    codes: usize,
    different_codes: usize,
}

#[test]
fn a_board_drops_whole_frames_and_counts_them_while_its_host_does_not_read() {
    let input = Input::from_environment();
    let expected = Boot::only(&host::sent(Streams::CODES, &input.samples)).codes();
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("stalled-host", &[]);
        // The samples come through a pipe, so that their number tells the virtual time of the board.
        let taken = Arc::new(AtomicUsize::new(0));
        let samples = input.samples.clone().into_iter().map({
            let taken = Arc::clone(&taken);
            move |sample| {
                taken.fetch_add(1, Relaxed);
                input::to_bytes(&[sample])
            }
        });
        or_panic(pipes::feed(&scenario.folder.join(input::FILE), samples));
        let begin_reading = input.samples.len() / STALLED;
        let sent = or_panic(pipes::run(
            scenario.qemu(&["start"]),
            &scenario.folder,
            &[],
            scenario.silence,
            || taken.load(Relaxed) > begin_reading,
        ));
        let boot = Boot::only(&sent);
        let figures = Figures {
            frames: boot.frames,
            frames_missing: boot.missing,
            frames_dropped: boot.last_stats().frames_dropped,
            codes: boot.timed_codes.len(),
            different_codes: different(&boot, &expected),
        };
        figures::record(Some(board.machine.name), &json!({"stalled_host": figures}));
        check(&boot, &expected);
    }
}

/// Number of codes that are not host-sim's of the same window.
fn different(boot: &Boot, expected: &[Code]) -> usize {
    let codes = boot.codes();
    let is_same = |code: &&Code| expected.get(code.window as usize) == Some(*code);
    codes.len() - codes.iter().filter(is_same).count()
}

fn check(boot: &Boot, expected: &[Code]) {
    let last = boot.last_stats();
    assert!(
        last.frames_dropped > 0,
        "nothing was dropped: the port was not stuck"
    );
    assert_eq!(
        boot.missing, last.frames_dropped,
        "missing frames, frames counted as dropped"
    );
    assert_eq!(boot.damaged, 0, "damaged frames");
    assert_eq!(
        different(boot, expected),
        0,
        "codes that are not host-sim's"
    );
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
    let boot = Boot::only(&sent);
    let refusal =
        |boot: &Boot| emulated::refusal::message(|| check(boot, &Boot::only(&sent).codes()));
    assert_eq!(
        refusal(&boot),
        "nothing was dropped: the port was not stuck"
    );

    let dropping = |counted, missing| {
        let mut boot = boot.clone();
        boot.missing = missing;
        boot.stats.last_mut().expect("counters").frames_dropped = counted;
        boot
    };
    assert_eq!(refusal(&dropping(3, 3)), "");
    let uncounted = refusal(&dropping(3, 4));
    assert!(uncounted.contains("left: 4\n right: 3"), "{uncounted}");
    let mut old = dropping(3, 3);
    old.timed_codes.truncate(20);
    assert_eq!(refusal(&old), "the newest code is 19 of 80");
    let mut wrong = dropping(3, 3);
    wrong.timed_codes[5].1.window += 1;
    let wrong = refusal(&wrong);
    assert!(
        wrong.contains("codes that are not host-sim's\n  left: 1"),
        "{wrong}"
    );
}
