//! Commands while codes stream.

use link::{Streams, ToDevice};

use virtual_board::{Cable, Kind, Trouble};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{acks, assert_sound, run_codes, running, stats, streaming};

/// Commands, back to back: the line is busy for some 50 ms.
const COMMANDS: u32 = 300;

/// Every command is received once, whatever the acquisition is doing, and answered or counted as dropped.
pub(crate) fn commands_arrive_while_codes_stream(subject: Subject) -> Result<(), Trouble> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    run_codes(&mut board, 16)?;
    let before = acks(board.inbox().frames());
    let counted = stats(board.inbox().frames()).expect("a report each second");
    let (commands, dropped) = (counted.commands, counted.frames_dropped);
    for _ in 0..COMMANDS {
        board.send(&ToDevice::Ping);
    }
    run_codes(&mut board, 40)?;
    let frames = board.inbox().frames();
    let stats = stats(frames).expect("a report each second");
    assert_eq!(stats.input_bad, 0, "commands that were damaged");
    assert_eq!(stats.commands - commands, COMMANDS, "commands received");
    // Answers may be dropped where the line is full, which is counted; USB has room for them.
    let answered = u32::try_from(acks(frames) - before).expect("few");
    let dropped = stats.frames_dropped - dropped;
    assert!(
        answered <= COMMANDS && answered + dropped >= COMMANDS,
        "{answered} answers, {dropped} dropped"
    );
    if subject.cable == Cable::Usb {
        assert_eq!(answered, COMMANDS);
    }
    assert_sound(&mut board)?;
    record(subject, "commands_answered", answered);
    Ok(())
}

/// Bytes of a million that arrive damaged, by each kind of error: about one command of twenty.
const DAMAGED: u32 = 2_500;

/// Bytes with framing errors and noise cost the commands that they are in, which are counted; none is obeyed
/// twice, and reception goes on.
pub(crate) fn a_damaged_line_costs_what_it_damages(subject: Subject) -> Result<(), Trouble> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let before = board.inbox().frames().len();
    board.damage_uart(DAMAGED)?;
    for _ in 0..COMMANDS {
        board.send(&ToDevice::Ping);
    }
    run_codes(&mut board, 40)?;
    board.damage_uart(0)?;
    let counted = *stats(board.inbox().frames()).expect("a report each second");
    assert!(counted.input_bad > 0, "nothing was damaged: {counted:?}");
    assert!(counted.commands < COMMANDS + 2, "{counted:?}");
    let mut answered: Vec<u32> = board.inbox().frames()[before..]
        .iter()
        .filter_map(|frame| match frame.kind {
            Kind::Ack(ack) => Some(ack.of),
            _ => None,
        })
        .collect();
    let all = answered.len();
    answered.sort_unstable();
    answered.dedup();
    assert_eq!(answered.len(), all, "a command was answered twice");

    let before = acks(board.inbox().frames());
    for _ in 0..20 {
        board.send(&ToDevice::Ping);
    }
    run_codes(&mut board, 8)?;
    assert_eq!(
        acks(board.inbox().frames()) - before,
        20,
        "reception went on"
    );
    assert_sound(&mut board)?;
    record(subject, "commands_damaged", counted.input_bad);
    Ok(())
}

/// Longest time for an answer on an idle line, us: the command's bytes, the answer's, and what a host looks at
/// every half millisecond. The conversation's own tick of 20 ms would be far later.
const ANSWER_US: u64 = 4_000;

/// A command wakes the conversation by itself, each time, while nothing streams.
pub(crate) fn an_idle_board_answers_at_once(subject: Subject) -> Result<(), Trouble> {
    let mut board = running(subject)?;
    for _ in 0..20 {
        let before = acks(board.inbox().frames());
        board.send(&ToDevice::Ping);
        board.run_until("an answer", ANSWER_US, |frames| acks(frames) > before)?;
        // No multiple of any period of the firmware.
        board.run_for_us(3_777)?;
    }
    assert_sound(&mut board)
}
