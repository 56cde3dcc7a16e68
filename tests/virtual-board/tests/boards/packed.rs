//! Comparison of a board's packed blocks with those of host-sim.

use link::{AckResult, Streams, ToDevice};
use virtual_board::{BoardError, Frame, Inbox, Kind, ReceivedCode};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{acks, assert_sound, in_time, running, start, worst_path};
use crate::simulation::{HOP, simulated};

/// Number of blocks to compare: more than from one block without prediction to the next.
const BLOCKS: usize = 70;

/// Time for which all streams run at once, seconds.
const SECONDS: u64 = 3;

/// Rate that the host asks for; the model has another one.
const RATE: ToDevice = ToDevice::SetRate { rate: 6 };

/// Streams that are compared with host-sim's.
const COMPARED: Streams = Streams::from_bits(Streams::PACKED.bits() | Streams::AUDIT.bits());

/// Packed blocks at a rate that the host chooses, and the planes of an audit, equal those of host-sim bit for bit, and
/// nothing is late or lost.
pub(crate) fn packed_blocks_equal_those_of_host_sim(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let answered = acks(board.inbox().frames());
    board.send(&RATE);
    board.run_until("an answer", 100_000, |frames| acks(frames) > answered)?;
    let before = board.converters().samples_delivered();
    start(&mut board, COMPARED)?;
    let after = board.converters().samples_delivered();
    let limit_us = BLOCKS as u64 * 62_500 + 300_000;
    let what = format!("{BLOCKS} blocks");
    board.run_until(&what, limit_us, |frames| blocks(frames).count() >= BLOCKS)?;

    let made: Vec<&ReceivedCode> = blocks(board.inbox().frames()).collect();
    let simulated = |first, samples| simulated(COMPARED, &[RATE], first, samples);
    let equals = |sample: u64| {
        let inbox: Inbox = simulated(sample, 2 * HOP);
        blocks(inbox.frames()).next() == made.first().copied()
    };
    // The blocks start at a sample between the `Start` command and its acknowledgement.
    let first = (before.saturating_sub(1)..=after + 1).find(|sample| equals(*sample));
    let first = first.expect("the first block equals none of host-sim's");
    let inbox = simulated(first, HOP * (made.len() as u64 + 1));
    let equal = made.iter().zip(blocks(inbox.frames()));
    assert_eq!(
        equal.filter(|(image, host)| *image == host).count(),
        made.len()
    );
    assert_eq!(audits(board.inbox().frames()), audits(inbox.frames()));
    let timing = in_time(&board);
    record(subject, "blocks", made.len());
    record(
        subject,
        "blocks_worst_path_over_deadline",
        format!("{:.3}", worst_path(&timing)),
    );
    assert_sound(&mut board)
}

/// With both encoders and everything else that a host asks for at once, nothing is late or lost.
pub(crate) fn everything_at_once_is_in_time(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    start(&mut board, Streams::ALL.without(Streams::COMPRESSED_RAW))?;
    let limit_us = BLOCKS as u64 * 62_500 + 300_000;
    board.run_until("blocks", limit_us, |frames| {
        blocks(frames).count() >= BLOCKS
    })?;
    let codes = board.inbox().codes().count();
    assert!(codes + 2 >= BLOCKS, "{codes} codes");
    let timing = in_time(&board);
    let worst = format!("{:.3}", worst_path(&timing));
    record(subject, "everything_worst_path_over_deadline", worst);
    assert_sound(&mut board)
}

/// An image without the network refuses codes, audits windows without a code, and is in time with all other streams.
pub(crate) fn codes_are_refused(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    for streams in [Streams::CODES, Streams::PACKED | Streams::CODES] {
        start(&mut board, streams)?;
        let acks = board.inbox().frames().iter().rev();
        let mut results = acks.filter_map(|frame| match frame.kind {
            Kind::Ack(ack) => Some(ack.result),
            _ => None,
        });
        assert_eq!(results.next(), Some(AckResult::BadArgument));
    }
    // All else that its port carries, at once.
    start(
        &mut board,
        Streams::ALL.without(Streams::CODES | Streams::RAW),
    )?;
    let limit_us = SECONDS * 1_000_000 + 300_000;
    let count = usize::try_from(SECONDS * 16).unwrap_or(usize::MAX);
    board.run_until("blocks", limit_us, |frames| blocks(frames).count() >= count)?;
    let is_code_less = |frame: &Frame| matches!(frame.kind, Kind::Audit { values: 0, .. });
    assert!(board.inbox().frames().iter().any(is_code_less));
    in_time(&board);
    assert_sound(&mut board)
}

/// Returns index and planes of each audited window.
fn audits(frames: &[Frame]) -> Vec<(u32, &[u8])> {
    let audits = frames.iter().filter_map(|frame| match &frame.kind {
        Kind::Audit { window, planes, .. } => Some((*window, &planes[..])),
        _ => None,
    });
    audits.collect()
}

fn blocks(frames: &[Frame]) -> impl Iterator<Item = &ReceivedCode> {
    frames.iter().filter_map(|frame| match &frame.kind {
        Kind::PackedCode(code) => Some(code),
        _ => None,
    })
}
