//! Commands while codes stream.

use link::{Streams, ToDevice};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{acks, assert_sound, run_codes, stats, streaming};

/// Commands, back to back: the line is busy for some 50 ms.
const COMMANDS: usize = 300;

/// Every command arrives whole and is answered once, whatever the acquisition is doing.
pub(crate) fn commands_arrive_while_codes_stream(subject: Subject) {
    let mut board = streaming(subject, Streams::CODES);
    run_codes(&mut board, 4).unwrap_or_else(|trouble| panic!("{trouble}"));
    let before = acks(board.inbox().frames());
    for _ in 0..COMMANDS {
        board.send(&ToDevice::Ping);
    }
    run_codes(&mut board, 40).unwrap_or_else(|trouble| panic!("{trouble}"));
    let frames = board.inbox().frames();
    let stats = stats(frames).expect("a report each second");
    assert_eq!(stats.input_bad, 0, "commands that were damaged");
    // Answers may be dropped where the line is full; that is counted, and every one was made.
    let answered = acks(frames) - before;
    assert!(
        answered + stats.frames_dropped as usize >= COMMANDS,
        "{answered} answers, {stats:?}"
    );
    assert!(stats.commands as usize >= COMMANDS, "{stats:?}");
    assert_sound(&mut board);
    record(subject, "commands_answered", answered);
}
