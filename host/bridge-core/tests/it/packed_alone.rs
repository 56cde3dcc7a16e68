//! A device whose model has the packed code alone: what is asked for, announced and reconstructed.

use std::path::Path;
use std::sync::Arc;

use artifact::{Artifact, Mode};
use bridge_core::{Model, PackedReconstruction, Settings};
use link::{Audit, CodeValues, Streams, ToHost};
use neuro_ros::DiagnosticLevel;

use crate::board::{Board, assert_has};
use crate::packed_device::{PACKED, Packed, flags, frames};
use crate::packed_fallback::restart_with;
use crate::recorder::{Harness, SETTINGS};

/// Streams of a device whose model has no network.
const SUPPORTED: Streams = Streams::ALL.without(Streams::CODES);

/// Returns the packed code of the built-in model as a model of its own.
fn model() -> Arc<Model> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/artifact");
    let built_in = Artifact::read(Path::new(folder)).unwrap();
    let mut description = built_in.description;
    description.mode = Mode::Packed;
    description.code.numbers = 0;
    let packed = built_in.packed.unwrap();
    let alone = Artifact::without_network(description, 640.0, packed).unwrap();
    Arc::new(Model::new(&alone).unwrap())
}

fn connected(settings: Settings) -> Harness {
    let model = model();
    let board = Board {
        model_id: model.id(),
        has_network: false,
        supported: SUPPORTED,
        ..Board::new()
    };
    let mut harness = Harness::with_model(settings, model, board);
    harness.connect();
    harness
}

fn device(settings: Settings) -> Packed {
    Packed::of(connected(settings))
}

#[test]
fn its_blocks_are_announced_and_reconstructed() {
    let mut device = device(PACKED);
    for lost in [false, false, true, false] {
        device.send(lost);
    }
    let recorder = &device.harness.recorder;
    let announced = &recorder.announced[0];
    assert!(announced.decodable && announced.info.is_some());
    assert!(recorder.encoded.is_empty());
    // The built-in model has the same packed code.
    let mut decoder = PackedReconstruction::new(&announced.device, &model(), PACKED).unwrap();
    for (block, expected) in recorder.blocks.iter().zip(frames(recorder, PACKED)) {
        assert_eq!(decoder.next_frame(block).unwrap().eeg, expected.eeg);
    }
    let is_flagged = flags(&frames(recorder, PACKED))
        .into_iter()
        .map(|flags| flags != 0);
    assert_eq!(is_flagged.collect::<Vec<_>>(), [false, false, true, true]);
}

/// The image lacks the network, and the model has it.
#[test]
fn what_is_announced_is_withdrawn_while_the_device_refuses_it() {
    let board = Board {
        supported: SUPPORTED,
        ..Board::new()
    };
    let mut harness = Harness::connected(SETTINGS, board);
    assert_eq!(harness.described(), [true, false]);
    // Another image.
    restart_with(&mut harness, Streams::ALL);
    assert_eq!(harness.described(), [true, false, true]);
}

#[test]
fn a_device_that_refuses_all_streams_has_no_announcement_until_another_image_runs() {
    let board = Board {
        supported: Streams::EVENTS,
        ..Board::new()
    };
    let mut harness = Harness::connected(SETTINGS, board);
    let last = |harness: &Harness| harness.recorder.announced.last().unwrap().info.is_some();
    assert!(!last(&harness));
    let status = harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Error);
    restart_with(&mut harness, Streams::ALL);
    assert!(last(&harness));
    let status = harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
}

#[test]
fn a_refusal_is_in_the_status_beside_a_model_that_the_bridge_does_not_have() {
    let board = Board {
        model_id: [9; 8],
        supported: Streams::EVENTS,
        ..Board::new()
    };
    let mut harness = Harness::connected(SETTINGS, board);
    let status = harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Error);
    for words in ["--model", "choose other --streams"] {
        assert_has(&status.message, [words]);
    }
}

#[test]
fn its_blocks_stream_in_the_place_of_codes_with_a_warning() {
    let mut device = device(SETTINGS);
    assert_eq!(device.harness.board.streams, Streams::PACKED);
    assert!(device.harness.recorder.announced[0].info.is_none());
    device.send(false);
    assert_eq!(device.harness.recorder.blocks.len(), 1);
    let status = device.harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    let remedy = "choose packed without codes";
    assert_has(&status.message, [remedy]);
    let keys: Vec<&str> = status
        .values
        .iter()
        .map(|value| value.key.as_str())
        .collect();
    assert!(!keys.contains(&"code format") && !keys.contains(&"recorder shift us /encoded"));
}

#[test]
fn its_audits_have_no_code_and_reach_the_decoder() {
    let settings = Settings {
        streams: Streams::PACKED | Streams::AUDIT,
        ..PACKED
    };
    let mut device = device(settings);
    device.send_all(2, false);
    let harness = &mut device.harness;
    assert_eq!(harness.board.streams, Streams::PACKED | Streams::AUDIT);
    let planes = vec![0; 16 * 90];
    let audit = ToHost::Audit(Audit {
        model_id: harness.board.model_id,
        window: 0,
        planes: &planes,
        values: CodeValues::int8(&[]),
    });
    harness.send(harness.now_us.unsigned_abs(), &audit);
    assert_eq!(harness.recorder.audits.len(), 1);
    assert!(harness.recorder.audits[0].levels.is_empty());
}
