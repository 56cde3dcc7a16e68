//! Scenarios in which the host uploads a model to a board.

use std::sync::LazyLock;

use any_model::{any_linear_for, any_packed_of};
use artifact::{Artifact, ModelId};
use link::{AckResult, MAX_CHUNK_BYTES, ModelBegin, ModelChunk, Streams, ToDevice, model_crc};
use virtual_board::{BoardError, Cable, Frame, Kind};

use crate::images::Subject;
use crate::packed::blocks;
use crate::session::{answer, assert_sound, in_time, pick, run_frames, running, stats, worst_path};
use crate::simulation::{HOP, Repeatable};

/// Returns the number of blocks to compare: for the default image, more than the interval between
/// blocks without prediction; for the image that differs only in the port, enough for a report.
const fn compared(subject: Subject) -> usize {
    match subject.cable {
        Cable::Usb => 70,
        Cable::Uart => A_REPORT,
    }
}

/// Number of blocks after which the device has sent its counters; it sends them once each second.
const A_REPORT: usize = 20;

/// Time limit from the answer to `ModelBegin` until the board reports the model, in us.
const fn longest_us(subject: Subject) -> u64 {
    match subject.cable {
        Cable::Usb => 2_000_000,
        Cable::Uart => 4_000_000,
    }
}

/// Id and bytes of the model that the scenarios upload: a packed model and a linear code with
/// random weights, in the shape of the built-in model.
static MODEL: LazyLock<(ModelId, Vec<u8>)> = LazyLock::new(|| {
    let built_in = Artifact::from_files(model::artifact_files::FILES).expect("the built-in model");
    let packed = any_packed_of(model::PACKED_COEFFICIENTS, 7, &built_in.description);
    let linear = any_linear_for(2, &built_in).expect("a linear code");
    let uploaded = linear.with_packed(Some(packed)).expect("a packed model");
    let bytes = model_gen::upload(&uploaded).expect("a sound model");
    (uploaded.id, bytes.expect("it has a packed model"))
});

/// Returns the id of [`MODEL`], and the commands that upload it.
pub(crate) fn upload() -> ([u8; 8], Vec<ToDevice<'static>>) {
    let (ModelId(id), bytes) = &*MODEL;
    let begin = ModelBegin {
        id: *id,
        bytes: u32::try_from(bytes.len()).expect("short"),
        crc: model_crc(bytes),
    };
    let chunks = (0..).step_by(MAX_CHUNK_BYTES).zip(bytes.chunks(MAX_CHUNK_BYTES));
    let chunks = chunks.map(|(offset, bytes)| ToDevice::ModelChunk(ModelChunk { offset, bytes }));
    let commands = [ToDevice::ModelBegin(begin)].into_iter().chain(chunks);
    (*id, commands.chain([ToDevice::ModelEnd]).collect())
}

/// Returns the id of the model that the board has reported last, and the device time of the report,
/// in us.
fn reported(frames: &[Frame]) -> ([u8; 8], u64) {
    let mut reports = frames.iter().filter_map(|frame| match frame.kind {
        Kind::Hello { model_id, .. } => Some((model_id, frame.device_us)),
        _ => None,
    });
    reports.next_back().expect("a Hello")
}

/// Scenario: a board to which a model was uploaded sends the same blocks and codes, bit for bit, as
/// host-sim with this model, and nothing is late or lost. The upload is as fast as the port allows.
pub(crate) fn uploaded_model_is_used(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    assert_eq!(reported(board.inbox().frames()).0, model::MODEL_ID);
    let (id, commands) = upload();
    let streams = Streams::PACKED | Streams::CODES;
    let run = Repeatable::start(&mut board, streams, &commands)?;
    let frames = board.inbox().frames();
    let announced = |frame: &&Frame| matches!(frame.kind, Kind::Ack(_));
    let first = frames.iter().find(announced).expect("answers");
    let (reported, last_us) = reported(frames);
    assert_eq!(reported, id);
    let upload_us = last_us - first.device_us;
    assert!(upload_us < longest_us(subject), "{upload_us} us");
    run_frames(&mut board, compared(subject), 62_500, |frames| blocks(frames).len())?;

    let (equal, inbox) = run.assert_equal(&board, HOP, blocks);
    let codes = board.inbox().codes().map(|(_, code)| code);
    let expected = inbox.codes().map(|(_, code)| code);
    let pairs: Vec<_> = codes.zip(expected).collect();
    assert!(pairs.len() + 3 > equal && pairs.iter().all(|(code, expected)| code == expected));
    let worst = worst_path(&in_time(&board));
    subject.record("upload_us", upload_us);
    subject.record("uploaded_blocks", equal);
    subject.record("uploaded_worst_path_over_deadline", format!("{worst:.3}"));
    assert_sound(&mut board)
}

/// Scenario: the board refuses an upload that is out of order, or whose bytes do not have the
/// announced CRC. A chunk that is damaged on the line counts as not sent. The board continues with
/// the built-in model.
pub(crate) fn unsound_upload_is_refused(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let (_, mut commands) = upload();
    let [ToDevice::ModelBegin(begin), chunk, next, ..] = &mut commands[..] else {
        panic!("no announcement and chunks")
    };
    begin.crc ^= 1;
    let (chunk, next, begin) = (*chunk, *next, ToDevice::ModelBegin(*begin));
    for (command, result) in [
        (ToDevice::ModelBegin(ModelBegin::default()), AckResult::BadArgument),
        (chunk, AckResult::BadArgument),
        (ToDevice::ModelEnd, AckResult::BadArgument),
        (begin, AckResult::Done),
        (next, AckResult::BadArgument),
    ] {
        assert_eq!(answer(&mut board, &command)?, result, "{command:?}");
    }
    let mut buffer = [0; link::MAX_FRAME];
    let mut encoder = link::Encoder::starting_at(u32::MAX);
    let frame = encoder.encode(0, &chunk, &mut buffer).expect("it fits");
    let mut damaged = frame.to_vec();
    damaged[100] ^= 1;
    board.port().send(&damaged);
    let end = commands.len() - 1;
    for command in &commands[1..end] {
        assert_eq!(answer(&mut board, command)?, AckResult::Done);
    }
    assert_eq!(answer(&mut board, &ToDevice::ModelEnd)?, AckResult::Failed);
    let is_answer =
        |kind: &Kind| matches!(kind, Kind::Ack(ack) if ack.of == u32::MAX).then_some(());
    assert_eq!(pick(board.inbox().frames(), is_answer).count(), 0);

    let run = Repeatable::start(&mut board, Streams::PACKED, &[])?;
    run_frames(&mut board, A_REPORT, 62_500, |frames| blocks(frames).len())?;
    run.assert_equal(&board, HOP, blocks);
    let frames = board.inbox().frames();
    assert_eq!(reported(frames).0, model::MODEL_ID);
    assert_eq!(stats(frames).expect("a report each second").input_bad, 1);
    assert_sound(&mut board)
}
