//! Comparison of a board's compressed samples with those of host-sim.

use link::Streams;
use virtual_board::{BoardError, Frame, Kind};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_sound, in_time, running, start};
use crate::simulation::{HOP, simulated};

/// Seconds of samples to compare.
const SECONDS: usize = 2;

/// Compressed samples, streamed together with codes, equal those of host-sim bit for bit, and nothing is late or lost.
pub(crate) fn compressed_samples_equal_those_of_host_sim(
    subject: Subject,
) -> Result<(), BoardError> {
    let streams = Streams::CODES | Streams::COMPRESSED_RAW;
    let mut board = running(subject)?;
    let before = board.converters().samples_delivered();
    start(&mut board, streams)?;
    let after = board.converters().samples_delivered();
    let due = SECONDS * 64;
    let limit_us = SECONDS as u64 * 1_000_000 + 300_000;
    board.run_until("samples", limit_us, |frames| samples(frames).count() >= due)?;

    let made: Vec<&[u8]> = samples(board.inbox().frames()).collect();
    let equals = |sample: u64| {
        let inbox = simulated(streams, &[], sample, HOP);
        samples(inbox.frames()).next() == made.first().copied()
    };
    let first = (before.saturating_sub(1)..=after + 1).find(|sample| equals(*sample));
    let first = first.expect("the first samples equal none of host-sim's");
    let inbox = simulated(streams, &[], first, 8 * (made.len() as u64 + 1));
    let equal = made.iter().zip(samples(inbox.frames()));
    assert_eq!(
        equal.filter(|(image, host)| *image == host).count(),
        made.len()
    );
    in_time(&board);
    record(subject, "compressed_frames", made.len());
    assert_sound(&mut board)
}

fn samples(frames: &[Frame]) -> impl Iterator<Item = &[u8]> {
    frames.iter().filter_map(|frame| match &frame.kind {
        Kind::CompressedRaw { bytes, .. } => Some(bytes.as_slice()),
        _ => None,
    })
}
