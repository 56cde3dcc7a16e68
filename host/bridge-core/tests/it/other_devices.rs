//! Devices whose model, shape or code format differs from the announced device's, newer devices,
//! and noise on the serial line.

use link::{AckResult, CodeFormat, CodeValues, Message, ToHost};

use crate::board::{Board, NUMBERS, Noise, assert_has};
use crate::recorder::{Harness, SETTINGS, commands};

#[test]
fn codes_of_another_model_are_published_without_a_reconstruction() {
    let mut harness = Harness::connected(SETTINGS, Board::of_another_model());
    harness.code(1, false);
    assert_eq!(harness.recorder.encoded.len(), 1);
    assert!(harness.recorder.windows.is_empty());
    assert!(!harness.recorder.announced[0].decodable);
    let report = harness.report("device");
    assert_has(&report, ["0909090909090909", "--model"]);
}

#[test]
fn a_device_of_another_shape_is_refused_until_the_first_one_returns() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.core.disconnected();
    let right = std::mem::replace(&mut harness.board, Board::of_another_shape());
    harness.connect();
    harness.code(1, false);
    assert_eq!(harness.recorder.encoded.len(), 1);
    assert_eq!(harness.core.summary().unused, 1);
    assert_has(&harness.report("device"), ["Error", "rate and window"]);
    harness.core.disconnected();
    harness.board = right;
    harness.connect();
    harness.code(1, false);
    // A filler takes the place of the refused device's code.
    assert_eq!(harness.fillers(), [false, true, false]);
    assert_has(&harness.report("device"), ["streaming"]);
}

#[test]
fn a_device_with_impossible_capabilities_is_refused() {
    for (hop_steps, step_rate_hz) in [(0, 128), (17, 136), (9, 128)] {
        let board = Board { hop_steps, step_rate_hz, ..Board::new() };
        let mut harness = Harness::connected(SETTINGS, board);
        harness.code(1, false);
        assert!(harness.recorder.announced.is_empty() && harness.recorder.encoded.is_empty());
    }
}

#[test]
fn another_board_that_streams_already_is_stopped_first() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.core.disconnected();
    harness.board = Board {
        chip_uid: [8; 12],
        session_id: 5,
        streaming: true,
        next_window: 1000,
        ..Board::new()
    };
    harness.connect();
    assert_eq!(commands(&harness), ["identify", "stop", "start"]);
    harness.code(2, false);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (2, 0));
    let announced = harness.recorder.announced.len();
    assert_eq!(announced, 2, "another chip is announced again");
}

#[test]
fn a_device_that_differs_from_the_announced_one_is_refused() {
    type Change = fn(&mut Board);
    let changes: [(&str, Change); 3] = [
        ("model", |board| board.model_id = [9; 8]),
        ("montage", |board| {
            board.labels = board.labels.replace("Cz", "XX");
        }),
        ("code format", |board| board.code_format = CodeFormat::Int16),
    ];
    for (what, change) in changes {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        harness.core.disconnected();
        harness.board = Board::new();
        harness.board.session_id = 5;
        change(&mut harness.board);
        harness.connect();
        harness.code(1, false);
        let report = harness.report("device");
        assert_has(&report, [&format!("in its {what};"), "restart"]);
        assert!(harness.recorder.encoded.is_empty());
    }
}

fn connected(code_format: CodeFormat) -> Harness {
    let board = Board { code_format, ..Board::new() };
    Harness::connected(SETTINGS, board)
}

/// Sends a code from a board whose code scale is 0.5. Returns the value that fills the frame on
/// `/encoded`, and the announced range.
fn published(values: &CodeValues) -> (f32, Vec<f64>) {
    let mut harness = connected(values.format());
    harness.code_of(values);
    let frame = &harness.recorder.encoded[0];
    assert_eq!(frame.eeg.data, [frame.eeg.data[0]; NUMBERS]);
    (frame.eeg.data[0], frame.eeg.info.minmax.clone())
}

#[test]
fn z_is_the_level_times_its_scale_in_every_format() {
    let bytes = [(-3_i8).cast_unsigned(); NUMBERS];
    let int8 = CodeValues::int8(&bytes);
    assert_eq!(published(&int8), (-2.0, vec![-64.5, 63.0]));
    for (exponent, z) in [(0, 50.0), (3, 400.0), (8, 12_800.0)] {
        let code = CodeValues::int8_exponent(exponent, &[100; NUMBERS]);
        assert_eq!(published(&code), (z, vec![-16_384.0, 16_256.0]));
    }
    for (step, z) in [(i16::MIN, -16_384.0), (1, 0.5), (i16::MAX, 16_383.5)] {
        let bytes = [step.to_le_bytes(); NUMBERS];
        let code = CodeValues::int16(bytes.as_flattened());
        assert_eq!(published(&code), (z, vec![-16_384.0, 16_383.5]));
    }
}

#[test]
fn a_code_of_another_model_format_or_length_than_announced_is_counted_and_not_published() {
    let model_id = Board::new().model_id;
    for (model_id, values) in [
        ([9; 8], CodeValues::int8(&[1; NUMBERS])),
        (model_id, CodeValues::int16(&[1; 2 * NUMBERS])),
        (model_id, CodeValues::int8(&[1; NUMBERS - 8])),
    ] {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        harness.code(1, false);
        let announced = std::mem::replace(&mut harness.board.model_id, model_id);
        harness.code_of(&values);
        harness.board.model_id = announced;
        harness.code(1, false);
        let summary = harness.core.summary();
        assert_eq!((summary.unused, summary.received, summary.lost), (1, 2, 1));
        assert_eq!(harness.fillers(), [false, true, false]);
    }
}

#[test]
fn a_device_with_a_newer_code_format_is_refused_with_advice() {
    let mut harness = connected(CodeFormat::Newer(3));
    assert!(harness.recorder.announced.is_empty());
    assert_has(&harness.report("device"), ["number 3", "same release"]);
}

/// A message of a later release: the number of a kind that this release does not know, and fields.
#[derive(serde::Serialize, serde::Deserialize)]
struct Later(u8, u8, u64);

impl Message<'_> for Later {
    const KINDS: u32 = ToHost::KINDS + 1;
    const DIRECTION: u8 = ToHost::DIRECTION;
}

#[test]
fn unknown_messages_of_a_newer_device_do_not_affect_codes() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    let mut buffer = [0; link::MAX_FRAME];
    let later = Later(u8::try_from(ToHost::KINDS).unwrap(), 1, 1_000_000);
    let bytes = harness.board.encoder.encode(0, &later, &mut buffer);
    let bytes = bytes.unwrap().to_vec();
    harness.receive(&bytes);
    harness.code(1, false);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (2, 0));
    assert_eq!((summary.frames_lost, summary.wire.unknown), (0, 1));
}

#[test]
fn a_device_with_another_wire_version_is_reported_as_such() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    let header = link::Header { version: 2, seq: 0, device_time_us: 0 };
    let mut buffer = [0; link::MAX_FRAME];
    let ack = ToHost::Ack(link::Ack { of: 0, result: AckResult::Done });
    harness.receive(link::encode(&header, &ack, &mut buffer).unwrap());
    let report = harness.report("link");
    assert_has(&report, ["another version", "same release"]);
}

#[test]
fn noise_never_publishes_anything() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let mut noise = Noise(1);
    let noise = (0..100_000).map(|_| noise.bits().to_be_bytes()[0]);
    harness.receive(&noise.collect::<Vec<u8>>());
    assert!(harness.recorder.encoded.is_empty());
    let wire = harness.core.summary().wire;
    assert!(wire.cobs + wire.crc + wire.oversize > 100, "{wire:?}");
    harness.receive(&[0]);
    harness.code(1, false);
    assert_eq!(harness.recorder.encoded.len(), 1);
}
