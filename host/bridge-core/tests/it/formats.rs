//! Dequantisation of codes of every format.

use link::{CodeFormat, CodeValues};

use crate::board::{Board, NUMBERS, assert_has};
use crate::recorder::{Harness, SETTINGS};

fn streaming(code_format: CodeFormat) -> Harness {
    let board = Board {
        code_format,
        ..Board::new()
    };
    Harness::streaming(SETTINGS, board)
}

/// Sends a code from a board whose code scale is 0.5. Returns the value that all places of the
/// frame on `/encoded` have, and the announced range.
fn published(values: &CodeValues) -> (f32, Vec<f64>) {
    let mut harness = streaming(values.format());
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
fn a_code_of_another_format_than_announced_is_counted_and_not_published() {
    let mut harness = streaming(CodeFormat::Int16);
    harness.code_of(&CodeValues::int16(&[1; 2 * NUMBERS]));
    harness.code_of(&CodeValues::int8(&[1; NUMBERS]));
    harness.code_of(&CodeValues::int16(&[1; 2 * NUMBERS]));
    let summary = harness.core.summary();
    assert_eq!((summary.unused, summary.received, summary.lost), (1, 2, 1));
}

#[test]
fn a_code_of_another_length_than_announced_is_counted_and_not_published() {
    let mut harness = streaming(CodeFormat::Int8);
    harness.code_of(&CodeValues::int8(&[1; NUMBERS]));
    harness.code_of(&CodeValues::int8(&[1; NUMBERS - 8]));
    harness.code_of(&CodeValues::int8(&[1; NUMBERS]));
    let summary = harness.core.summary();
    assert_eq!((summary.unused, summary.received, summary.lost), (1, 2, 1));
}

#[test]
fn a_device_with_a_newer_code_format_is_refused_with_advice() {
    let board = Board {
        code_format: CodeFormat::Newer(3),
        ..Board::new()
    };
    let mut harness = Harness::connected(SETTINGS, board);
    assert!(harness.recorder.announced.is_empty());
    let now = crate::board::at(harness.now_us);
    let device = harness.core.diagnostics(now).status.remove(0);
    let message = &device.message;
    assert_has(&message, ["number 3", "same release"]);
}

#[test]
fn another_device_with_another_format_is_refused() {
    let mut harness = streaming(CodeFormat::Int8);
    harness.core.disconnected();
    harness.board = Board {
        code_format: CodeFormat::Int16,
        session_id: 2,
        ..Board::new()
    };
    harness.connect();
    harness.code_of(&CodeValues::int16(&[1; 2 * NUMBERS]));
    assert!(harness.recorder.encoded.is_empty());
    let now = crate::board::at(harness.now_us);
    let device = harness.core.diagnostics(now).status.remove(0);
    assert_has(&device.message, ["code format"]);
}
