//! Dequantisation of codes of every format.

use link::{CODE_LEN, CodeFormat, CodeValues};

use crate::board::Board;
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
    assert_eq!(frame.eeg.data, [frame.eeg.data[0]; CODE_LEN]);
    (frame.eeg.data[0], frame.eeg.info.minmax.clone())
}

#[test]
fn z_is_the_level_times_its_scale_in_every_format() {
    let int8 = CodeValues::Int8([-3; CODE_LEN]);
    assert_eq!(published(&int8), (-2.0, vec![-64.5, 63.0]));
    for (exponent, z) in [(0, 50.0), (3, 400.0), (8, 12_800.0)] {
        let values = [100; CODE_LEN];
        let code = CodeValues::Int8Exponent { exponent, values };
        assert_eq!(published(&code), (z, vec![-16_384.0, 16_256.0]));
    }
    for (step, z) in [(-32_768, -16_384.0), (1, 0.5), (32_767, 16_383.5)] {
        let code = CodeValues::Int16([step; CODE_LEN]);
        assert_eq!(published(&code), (z, vec![-16_384.0, 16_383.5]));
    }
}

#[test]
fn a_code_of_another_format_than_announced_is_counted_and_not_published() {
    let mut harness = streaming(CodeFormat::Int16);
    harness.code_of(&CodeValues::Int16([1; CODE_LEN]));
    harness.code_of(&CodeValues::Int8([1; CODE_LEN]));
    harness.code_of(&CodeValues::Int16([1; CODE_LEN]));
    let summary = harness.core.summary();
    assert_eq!((summary.unused, summary.received, summary.lost), (1, 2, 1));
}

#[test]
fn a_device_with_a_newer_code_format_is_refused_with_advice() {
    let board = Board {
        code_format: CodeFormat::Newer(3),
        ..Board::new()
    };
    let mut harness = Harness::new(SETTINGS, board);
    harness.connect();
    assert!(harness.recorder.announced.is_empty());
    let now = crate::board::at(harness.now_us);
    let device = harness.core.diagnostics(now).status.remove(0);
    let message = &device.message;
    assert!(
        message.contains("number 3") && message.contains("same release"),
        "{message}"
    );
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
    harness.code_of(&CodeValues::Int16([1; CODE_LEN]));
    assert!(harness.recorder.encoded.is_empty());
    let now = crate::board::at(harness.now_us);
    let device = harness.core.diagnostics(now).status.remove(0);
    assert!(device.message.contains("code format"), "{}", device.message);
}
