//! Scenario with a host that reads nothing for a third of the run: the board drops whole frames,
//! the oldest first, and counts each of them.

use std::fs::{File, OpenOptions};
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use emulated::board::{Board, boards, or_panic};
use emulated::frames::{self, Boot, SentCode};
use emulated::input::{self, Input};
use emulator::{Uart, pipes};
use link::Streams;
use rustix::pipe::fcntl_setpipe_size;
use serde_json::json;

/// Number of equal parts of the run. The host reads nothing during the first part, which is at
/// least 10 s long. Pipe and queue are full after 3 s, so the board must drop frames.
const STALLED_PART: usize = 3;

/// Interval at which the reader checks whether it may start to read from the pipe.
const POLL: Duration = Duration::from_millis(5);

/// Capacity of the UART's pipe, bytes: one second of codes. The board's queue holds two more
/// seconds.
const CAPACITY: usize = 4096;

#[test]
fn a_board_drops_whole_frames_and_counts_them_while_its_host_does_not_read() {
    let input = Input::from_environment();
    let expected = Boot::only(&frames::simulated(Streams::CODES, &input.samples)).codes();
    for board in boards("stalled-host", &input.samples) {
        // Pass the samples through a pipe: the number of samples that the board has read indicates
        // its virtual time.
        let taken = Arc::new(AtomicUsize::new(0));
        let counter = Arc::clone(&taken);
        let samples = input.samples.clone().into_iter().map(move |sample| {
            counter.fetch_add(1, Relaxed);
            input::to_bytes(&[sample])
        });
        or_panic(pipes::feed(&board.folder.join(input::FILE), samples));
        let stalled = input.samples.len() / STALLED_PART;
        let boot = Boot::only(&run(&board, || taken.load(Relaxed) > stalled));
        let last = boot.last_stats();
        let codes = boot.codes();
        let is_different = |code: &&SentCode| expected.get(code.window as usize) != Some(*code);
        let different = codes.iter().filter(is_different).count();
        board.record(&json!({"stalled_host": {
            "frames": boot.frames,
            "frames_missing": boot.missing,
            "frames_dropped": last.frames_dropped,
            "codes": codes.len(),
            "different_codes": different,
        }}));
        assert!(last.frames_dropped > 0, "nothing was dropped: the port was not stuck");
        assert_eq!(boot.missing, last.frames_dropped, "missing frames, dropped frames");
        assert_eq!(boot.damaged, [], "damaged frames");
        assert_eq!(different, 0, "codes that are not host-sim's for their window");
        assert_eq!(last.overruns, 0, "overruns");
        let newest = codes.last().map_or(0, |code| code.window as usize);
        let two_seconds = 2 * usize::from(model::STEP_RATE_HZ) / model::HOP;
        let count = expected.len();
        assert!(newest + two_seconds > count, "the newest code is {newest} of {count}");
    }
}

/// Runs the image to its end and returns the bytes from its UART. No byte is read before `may_read`
/// returns true.
fn run(board: &Board, may_read: impl Fn() -> bool + Sync) -> Vec<u8> {
    let path = board.folder.join("uart.out");
    or_panic(pipes::create(&board.folder.join("uart.in")));
    or_panic(pipes::create(&path));
    // Opening the pipe for both reading and writing does not wait for QEMU. While `both` exists,
    // the reader sees no end of file.
    let both = OpenOptions::new().read(true).write(true).open(&path);
    let both = both.expect("a pipe that exists");
    fcntl_setpipe_size(&both, CAPACITY).expect("a possible capacity");
    let mut pipe = File::open(&path).expect("a pipe that exists");
    let ended = AtomicBool::new(false);
    thread::scope(|scope| {
        let reader = scope.spawn(|| {
            while !may_read() && !ended.load(Relaxed) {
                thread::sleep(POLL);
            }
            let mut sent = Vec::new();
            pipe.read_to_end(&mut sent).map(|_| sent)
        });
        let mut qemu = board.qemu(&["start"]);
        let lines = qemu.uart(Uart::Pipes("uart")).run(board.silence, |_| ());
        ended.store(true, Relaxed);
        drop(both);
        or_panic(lines);
        let sent = reader.join().expect("the reader ends");
        sent.expect("a pipe that can be read")
    })
}
