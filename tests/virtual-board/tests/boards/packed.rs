//! Scenarios in which packed blocks and compressed samples must equal host-sim's.

use link::{AckResult, BandPass, FeatureFilters, Streams, ToDevice};
use virtual_board::{BoardError, Frame, Kind, ReceivedCode};

use crate::images::Subject;
use crate::session::{answer, assert_sound, in_time, pick, run_frames, running, start, worst_path};
use crate::simulation::{EXCLUDE, HOP, Repeatable, assert_substituted};
use crate::upload::upload;

/// Number of blocks to compare, more than the interval between blocks without prediction.
const BLOCKS: usize = 70;

/// Duration in seconds for which an image without the network streams everything but codes and raw
/// samples.
const SECONDS: usize = 3;

/// Command that sets a rate other than the model's default.
const RATE: ToDevice<'_> = ToDevice::SetRate { rate: 6 };

/// Command that sets two spatial filters, with a band-pass of 8 to 30 Hz.
const FILTERS: ToDevice<'_> = ToDevice::SetFeatures(FeatureFilters {
    id: 5,
    first: BandPass { gain: 1_732_880_386, a1: 6_412_710_145, a2: -2_805_971_273 },
    second: BandPass { gain: 1_732_880_386, a1: 1_285_160_498, a2: -1_524_016_507 },
    weights: &{
        let mut weights = [31; 2 * model::ELECTRODES];
        weights[7] = 0x81;
        weights[80] = 127;
        weights
    },
});

/// Scenario: packed blocks, features and audited planes equal host-sim's bit for bit, and nothing
/// is late or lost. The host chooses the rate of the blocks, and electrodes are substituted.
pub(crate) fn packed_blocks_equal_those_of_host_sim(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let streams = Streams::PACKED | Streams::AUDIT | Streams::FEATURES;
    let run = Repeatable::start(&mut board, streams, &[RATE, EXCLUDE, FILTERS])?;
    run_frames(&mut board, BLOCKS, 62_500, |frames| blocks(frames).len())?;

    let (equal, inbox) = run.assert_equal(&board, HOP, blocks);
    assert_eq!(audits(board.inbox().frames()), audits(inbox.frames()));
    let made = features(board.inbox().frames());
    assert!(made.len() + 1 >= BLOCKS, "{} features", made.len());
    assert!(features(inbox.frames()).starts_with(&made[..BLOCKS - 1]));
    assert_substituted(&blocks(board.inbox().frames()));
    let worst = worst_path(&in_time(&board));
    subject.record("blocks", equal);
    subject.record("blocks_worst_path_over_deadline", format!("{worst:.3}"));
    assert_sound(&mut board)
}

/// Scenario: nothing is late or lost while both encoders run and the host asks for all streams at
/// once, except the compressed samples, which replace the raw ones.
pub(crate) fn everything_at_once_is_in_time(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    start(&mut board, Streams::ALL.without(Streams::COMPRESSED_RAW))?;
    run_frames(&mut board, BLOCKS, 62_500, |frames| blocks(frames).len())?;
    let codes = board.inbox().codes().count();
    assert!(codes + 2 >= BLOCKS, "{codes} codes");
    let timing = in_time(&board);
    let worst = format!("{:.3}", worst_path(&timing));
    subject.record("everything_worst_path_over_deadline", worst);
    assert_sound(&mut board)
}

/// Scenario: an image without the network and without memory for an uploaded model refuses to
/// stream codes and to accept a model. Its audits contain no code. It meets all deadlines while all
/// other streams run.
pub(crate) fn codes_and_uploads_are_refused(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let [begin, ..] = upload().1[..] else { panic!("no announcement") };
    assert_eq!(answer(&mut board, &begin)?, AckResult::NotSupported);
    for streams in [Streams::CODES, Streams::PACKED | Streams::CODES] {
        assert_eq!(start(&mut board, streams)?, AckResult::BadArgument);
    }
    // Start all other streams that the UART can carry at the same time.
    start(&mut board, Streams::ALL.without(Streams::CODES | Streams::RAW))?;
    run_frames(&mut board, 16 * SECONDS, 62_500, |frames| blocks(frames).len())?;
    let is_code_less = |frame: &Frame| matches!(frame.kind, Kind::Audit { values: 0, .. });
    assert!(board.inbox().frames().iter().any(is_code_less));
    in_time(&board);
    assert_sound(&mut board)
}

fn features(frames: &[Frame]) -> Vec<&[u8]> {
    let features = pick(frames, |kind| match kind {
        Kind::Features(bytes) => Some(&bytes[..]),
        _ => None,
    });
    features.collect()
}

/// Returns the number and the planes of each audited window.
fn audits(frames: &[Frame]) -> Vec<(u32, &[u8])> {
    let audits = pick(frames, |kind| match kind {
        Kind::Audit { window, planes, .. } => Some((*window, &planes[..])),
        _ => None,
    });
    audits.collect()
}

pub(crate) fn blocks(frames: &[Frame]) -> Vec<ReceivedCode> {
    let block = |kind: &Kind| match kind {
        Kind::PackedCode(code) => Some(code.clone()),
        _ => None,
    };
    pick(frames, block).collect()
}

/// Scenario: compressed samples, streamed together with codes, equal host-sim's bit for bit, and
/// nothing is late or lost.
pub(crate) fn compressed_samples_equal_those_of_host_sim(
    subject: Subject,
) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let streams = Streams::CODES | Streams::COMPRESSED_RAW;
    let run = Repeatable::start(&mut board, streams, &[])?;
    run_frames(&mut board, 64 * 2, 15_625, |frames| samples(frames).len())?;

    let (equal, _) = run.assert_equal(&board, 8, samples);
    in_time(&board);
    subject.record("compressed_frames", equal);
    assert_sound(&mut board)
}

fn samples(frames: &[Frame]) -> Vec<Vec<u8>> {
    let samples = |kind: &Kind| match kind {
        Kind::CompressedRaw(bytes) => Some(bytes.clone()),
        _ => None,
    };
    pick(frames, samples).collect()
}
