//! Reactions of the bridge to newer devices, to other versions of the wire format, and to noise.

use link::{AckResult, FrameError, ToHost};

use crate::board::{Board, assert_has, at};
use crate::recorder::{Harness, SETTINGS};

/// Messages of a later release, which has one kind more than this release.
#[derive(serde::Serialize, serde::Deserialize)]
enum LaterToHost {
    Hello,
    Capabilities,
    Code,
    Stats,
    Ack,
    Quality,
    Timing,
    Raw,
    Filtered,
    Audit,
    Event,
    Converters,
    SelfTest,
    ClockReading,
    Substitutes,
    CompressedRaw,
    PackedCode,
    Later { channel: u8, device_time_us: u64 },
}

impl link::Message<'_> for LaterToHost {
    const KINDS: u32 = 18;
    const DIRECTION: u8 = link::ToHost::DIRECTION;
}

#[test]
fn unknown_messages_of_a_newer_device_do_not_affect_codes() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    let mut buffer = [0; link::MAX_FRAME];
    let later = LaterToHost::Later {
        channel: 1,
        device_time_us: 1_000_000,
    };
    let bytes = harness
        .board
        .encoder
        .encode(0, &later, &mut buffer)
        .unwrap();
    harness
        .core
        .receive(bytes, at(harness.now_us), &mut harness.recorder);
    harness.code(1, false);
    let summary = harness.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.frames_lost),
        (2, 0, 0)
    );
    assert_eq!((summary.wire.unknown, summary.wire.resyncs), (1, 0));
}

#[test]
fn a_device_with_another_wire_version_is_reported_as_such() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.open();
    let header = link::Header {
        version: 2,
        seq: 0,
        device_time_us: 0,
    };
    let mut buffer = [0; link::MAX_FRAME];
    let ack = ToHost::Ack(link::Ack {
        of: 0,
        result: AckResult::Done,
    });
    let bytes = link::encode(&header, &ack, &mut buffer).unwrap();
    harness
        .core
        .receive(bytes, at(harness.now_us), &mut harness.recorder);
    let report = harness.report("link");
    assert_has(&report, ["another version", "same release"]);
}

#[test]
fn noise_never_publishes_anything() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let mut state = 1u32;
    let noise: Vec<u8> = (0..100_000)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.to_be_bytes()[0]
        })
        .collect();
    harness.receive(&noise);
    assert!(harness.recorder.encoded.is_empty());
    let wire = harness.core.summary().wire;
    assert!(wire.cobs + wire.crc + wire.oversize > 100, "{wire:?}");
    harness.receive(&[0]);
    harness.code(1, false);
    assert_eq!(harness.recorder.encoded.len(), 1);
    assert!(FrameError::Crc.to_string().contains("damaged"));
}
