//! Commands to a streaming and to an idle board.

use link::{Streams, ToDevice};

use virtual_board::{BoardError, Cable, Kind};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{acks, assert_sound, run_codes, running, stats, streaming};

/// Number of commands sent back to back; over the UART they take about 50 ms.
const COMMANDS: u32 = 300;

/// While codes stream, every command is received once, and its acknowledgement is sent or counted as dropped.
pub(crate) fn commands_arrive_while_codes_stream(subject: Subject) -> Result<(), BoardError> {
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
    assert_eq!(stats.input_bad, 0, "damaged commands");
    assert_eq!(stats.commands - commands, COMMANDS, "commands received");
    // Acknowledgements that do not fit into the UART's buffer are dropped and counted. USB has the capacity
    // for all of them.
    let answered = u32::try_from(acks(frames) - before).expect("fewer than 2^32");
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

/// Rate of framing errors and, separately, of noise, in bytes per million. Together they damage about one
/// command in twenty.
const DAMAGED: u32 = 2_500;

/// A byte with a framing error or noise destroys only the command that contains it, and damaged commands
/// are counted. No command is executed twice, and reception continues.
pub(crate) fn damaged_bytes_destroy_only_their_commands(
    subject: Subject,
) -> Result<(), BoardError> {
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
        "acknowledgements after the damage"
    );
    assert_sound(&mut board)?;
    record(subject, "commands_damaged", counted.input_bad);
    Ok(())
}

/// Longest response time on an idle line, in us: the transfer of both frames, and the polling interval of
/// the test, 500 us. If the conversation task handled commands only at its 20 ms tick, most responses would
/// take longer.
const ANSWER_US: u64 = 4_000;

/// While nothing streams, each command wakes the conversation task immediately.
pub(crate) fn an_idle_board_answers_at_once(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    for _ in 0..20 {
        let before = acks(board.inbox().frames());
        board.send(&ToDevice::Ping);
        board.run_until("an answer", ANSWER_US, |frames| acks(frames) > before)?;
        // The interval is not a multiple of any period of the firmware, so commands arrive at varying
        // points of each period.
        board.run_for_us(3_777)?;
    }
    assert_sound(&mut board)
}
