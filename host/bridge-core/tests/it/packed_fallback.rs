//! Devices that refuse packed blocks or codes: what the bridge announces, streams and decodes in
//! their place.

use std::path::Path;
use std::sync::Arc;

use artifact::{Artifact, Mode};
use bridge_core::{
    AnnouncedStream, Announcement, EventStamps, Model, PackedReconstruction, Settings,
};
use link::{Audit, CodeValues, Event, EventKind, Streams, ToHost};
use neuro_ros::{DiagnosticLevel, KeyValue};

use crate::board::{Board, WALL_START_NS, assert_has};
use crate::packed_device::{PACKED, Packed, flags, frames};
use crate::recorder::{Harness, SETTINGS};

/// Streams of a firmware image that has the network but not the packed code.
const NETWORK: Streams = Streams::ALL.without(Streams::PACKED);

/// Returns a bridge that wants packed blocks and events, with a board that has the `supported`
/// streams and a hop of 4 steps.
fn harness(supported: Streams, low_latency: bool) -> Harness {
    let settings = Settings {
        streams: Streams::PACKED | Streams::EVENTS,
        event_stamps: EventStamps::Recorder,
        low_latency,
        ..PACKED
    };
    let board = Board { supported, hop_steps: 4, ..Board::new() };
    Harness::connected(settings, board)
}

/// Returns what the announced signals are decoded from, as `/acquisition/get_info` states it.
fn origin(announced: &Announcement) -> &str {
    let info = announced.info.as_ref().unwrap();
    &info.frame().eeg.info.transducter
}

#[test]
fn codes_in_the_place_of_blocks_are_announced_and_decoded() {
    let mut harness = Harness::connected(PACKED, Board::supporting(NETWORK));
    assert_eq!(origins(&harness), ["packed code", "autoencoder"]);
    harness.code(1, false);
    assert_eq!(harness.recorder.windows.len(), 1);
    // Now the same device runs an image that has the packed code.
    restart_with(&mut harness, Streams::ALL);
    assert_eq!(origins(&harness)[2..], ["packed code"]);
    let mut device = Packed::of(harness);
    device.send(false);
    assert_eq!(device.harness.recorder.blocks.len(), 1);
}

#[test]
fn events_are_shifted_by_the_delay_of_the_stream_that_is_decoded() {
    // The part of the recorder shift that does not depend on the stream: group delay 10 ms, less a
    // frame of four steps (31.25 ms), plus 1.5 steps.
    let rest_us = 10_000 - 31_250 + 11_718;
    for (supported, low_latency, steps_us) in [
        // Expected times from a frame's first step until the frame is complete, microseconds: 15
        // steps if the frame is decoded from codes, 7 steps if from blocks, 3 steps with low
        // latency.
        (NETWORK, false, 117_187),
        (Streams::ALL, false, 54_687),
        (NETWORK, true, 23_437),
        (Streams::ALL, true, 23_437),
    ] {
        let mut harness = harness(supported, low_latency);
        let expected_us = steps_us + rest_us;
        let key = "recorder shift us /neurodata_reconstructed";
        let shift_us: i64 = harness.figure("device", key).parse().unwrap();
        assert!((shift_us - expected_us).abs() <= 2, "{shift_us}");
        harness.code(1, false);
        let happened_us = harness.now_us + 10_000;
        harness.now_us += 20_000;
        let event = Event { kind: EventKind::TriggerRise, number: 1, sample: 40 };
        harness.send(happened_us.unsigned_abs(), &ToHost::Event(event));
        let stamp_ns = harness.recorder.events[0].header.stamp.nanoseconds();
        let shifted_us = (stamp_ns - WALL_START_NS) / 1000 - happened_us;
        assert!((shifted_us - expected_us).abs() <= 2, "{shifted_us} {expected_us}");
    }
}

/// Restarts the board with another image, which supports the `supported` streams. The restart takes
/// one hop, and the first code comes another hop later. By then, both hops of its window have
/// passed.
fn restart_with(harness: &mut Harness, supported: Streams) {
    harness.board.supported = supported;
    harness.reboot(62_500);
}

#[test]
fn the_time_in_which_codes_were_decoded_is_not_filled_when_packed_blocks_return() {
    let settings = Settings { low_latency: false, ..PACKED };
    let mut device = Packed::new(settings);
    device.send_all(5, false);
    restart_with(&mut device.harness, NETWORK);
    // The frame of the last block is published before the first frame that is decoded from a code.
    assert_eq!(device.harness.recorder.finished, [5]);
    device.harness.codes(160, 1);
    restart_with(&mut device.harness, Streams::ALL);
    device.next = 0;
    device.send_all(5, false);
    let recorder = &device.harness.recorder;
    assert_eq!(recorder.windows.len(), 160);
    assert!(recorder.blocks.len() == 10 && recorder.blocks[5].is_first);
    let frames = frames(recorder, settings);
    assert_eq!(frames.len(), 9, "the newest block waits");
    assert!(flags(&frames).iter().all(|flags| *flags == 0));
    let stamp = |frame: usize| frames[frame].header.stamp.nanoseconds();
    let newest_code = recorder.windows[159].stamp.nanoseconds();
    assert!(stamp(4) < recorder.windows[0].stamp.nanoseconds());
    assert!(newest_code < stamp(5));
}

#[test]
fn the_time_in_which_packed_blocks_were_decoded_is_filled_among_codes_alone() {
    let settings = Settings { streams: Streams::CODES | Streams::PACKED, ..PACKED };
    let mut harness = Harness::connected(settings, Board::supporting(NETWORK));
    harness.codes(5, 1);
    // Now the device runs an image without the network.
    restart_with(&mut harness, Streams::PACKED);
    let mut device = Packed::of(harness);
    device.send_all(20, false);
    let mut harness = device.harness;
    restart_with(&mut harness, NETWORK);
    // The first code of the new run is lost.
    harness.code(1, true);
    harness.codes(5, 1);
    let fillers = [&[false; 5][..], &[true; 23], &[false; 5]].concat();
    assert_eq!(harness.fillers(), fillers);
    let windows = &harness.recorder.windows;
    let lost: Vec<bool> = windows.iter().map(|window| window.z.is_none()).collect();
    assert_eq!(lost, [&[false; 5][..], &[true], &[false; 5]].concat());
}

fn origins(harness: &Harness) -> Vec<&str> {
    harness.recorder.announced.iter().map(origin).collect()
}

#[test]
fn signals_are_decoded_although_the_acknowledgement_of_the_start_was_lost() {
    let mut harness = Harness::new(PACKED, Board::supporting(NETWORK));
    harness.open();
    harness.start_unacknowledged();
    assert_eq!(origins(&harness), ["packed code"]);
    harness.codes(6, 1);
    assert_eq!(origins(&harness), ["packed code", "autoencoder"]);
    let recorder = &harness.recorder;
    assert_eq!((recorder.encoded.len(), recorder.windows.len()), (6, 6));
    // The acknowledgement is lost again, after a restart with an image that has the packed code.
    harness.board.reboot();
    harness.board.supported = Streams::ALL;
    let hello = harness.board.hello();
    harness.receive(&hello);
    harness.start_unacknowledged();
    let mut device = Packed::of(harness);
    device.send_all(6, false);
    assert_eq!(origins(&device.harness).len(), 3);
    assert_eq!(device.harness.recorder.blocks.len(), 6);
}

#[test]
fn codes_that_a_device_refuses_are_not_described_until_it_streams_them() {
    let settings = Settings {
        streams: Streams::CODES | Streams::PACKED,
        announced: AnnouncedStream::Encoded,
        ..PACKED
    };
    for (settings, supported) in [(settings, Streams::PACKED), (SETTINGS, SUPPORTED)] {
        let mut harness = Harness::connected(settings, Board::supporting(supported));
        assert_eq!(harness.described(), [true, false]);
        restart_with(&mut harness, Streams::ALL);
        assert_eq!(harness.described(), [true, false, true]);
    }
}

/// Streams of a device whose model has no network, so no codes.
const SUPPORTED: Streams = Streams::ALL.without(Streams::CODES);

/// Returns a model that has the packed code of the embedded model, but no network.
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

/// Returns a bridge and a device that both have the model without a network.
fn device(settings: Settings) -> Packed {
    let model = model();
    let board =
        Board { model_id: model.id(), has_network: false, supported: SUPPORTED, ..Board::new() };
    let mut harness = Harness::with_model(settings, model, board);
    harness.connect();
    Packed::of(harness)
}

#[test]
fn blocks_of_a_device_without_a_network_are_announced_and_reconstructed() {
    let mut device = device(PACKED);
    for lost in [false, false, true, false] {
        device.send(lost);
    }
    let recorder = &device.harness.recorder;
    let announced = &recorder.announced[0];
    assert!(announced.decodable && announced.info.is_some());
    assert!(recorder.encoded.is_empty());
    // The embedded model, which `frames` uses, has the same packed code and must decode alike.
    let mut decoder = PackedReconstruction::new(&announced.device, &model(), PACKED).unwrap();
    for (block, expected) in recorder.blocks.iter().zip(frames(recorder, PACKED)) {
        assert_eq!(decoder.next_frame(block).unwrap().eeg, expected.eeg);
    }
    let flags = flags(&frames(recorder, PACKED));
    let is_flagged = flags.into_iter().map(|flags| flags != 0);
    assert!(is_flagged.eq([false, false, true, true]));
}

#[test]
fn a_device_that_refuses_all_streams_has_no_announcement_until_another_image_runs() {
    let mut harness = Harness::connected(SETTINGS, Board::supporting(Streams::EVENTS));
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
    let board = Board { supported: Streams::EVENTS, ..Board::of_another_model() };
    let mut harness = Harness::connected(SETTINGS, board);
    let status = harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Error);
    assert_has(&status.message, ["--model", "choose other --streams"]);
}

#[test]
fn blocks_of_a_device_without_a_network_replace_codes_with_a_warning() {
    let mut device = device(SETTINGS);
    assert_eq!(device.harness.board.streams, Streams::PACKED);
    assert!(device.harness.recorder.announced[0].info.is_none());
    device.send(false);
    assert_eq!(device.harness.recorder.blocks.len(), 1);
    let status = device.harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert_has(&status.message, ["choose packed without codes"]);
    let of_codes = ["code format", "recorder shift us /encoded"];
    let is_of_codes = |value: &KeyValue| of_codes.contains(&&*value.key);
    assert!(!status.values.iter().any(is_of_codes), "{status:?}");
}

#[test]
fn audits_of_a_device_without_a_network_have_no_code_and_reach_the_decoder() {
    let settings = Settings { streams: Streams::PACKED | Streams::AUDIT, ..PACKED };
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
