//! A device that refuses packed blocks and streams codes in their place: what is announced and reconstructed.

use bridge::{Announcement, EventStamps, Settings};
use link::{Event, EventKind, Streams, ToHost};

use crate::board::{Board, WALL_START_NS};
use crate::packed_device::{PACKED, Packed};
use crate::recorder::Harness;

/// Streams of an image without the packed code.
const NETWORK: Streams = Streams::ALL.without(Streams::PACKED);

/// Returns a bridge that wants packed blocks and events, and a board with `supported` streams and a hop of 4 steps.
fn harness(supported: Streams, low_latency: bool) -> Harness {
    let settings = Settings {
        streams: Streams::PACKED | Streams::EVENTS,
        event_stamps: EventStamps::Recorder,
        low_latency,
        ..PACKED
    };
    let board = Board {
        supported,
        hop_steps: 4,
        ..Board::new()
    };
    let mut harness = Harness::new(settings, board);
    harness.connect();
    harness
}

/// Returns where the recorder's signals come from, by the answer to `/acquisition/get_info`.
fn origin(announced: &Announcement) -> &str {
    &announced
        .info
        .as_ref()
        .unwrap()
        .frame()
        .eeg
        .info
        .transducter
}

fn shift_us(harness: &mut Harness) -> i64 {
    let values = harness.status("device").unwrap().values;
    let key = "recorder shift us /neurodata_reconstructed";
    let pair = values.iter().find(|pair| pair.key == key).unwrap();
    pair.value.parse().unwrap()
}

#[test]
fn codes_in_the_place_of_blocks_are_announced_and_decoded() {
    let board = Board {
        supported: NETWORK,
        ..Board::new()
    };
    let mut harness = Harness::new(PACKED, board);
    harness.connect();
    let origins: Vec<&str> = harness.recorder.announced.iter().map(origin).collect();
    assert_eq!(origins, ["packed code", "autoencoder"]);
    harness.code(1, false);
    assert_eq!(harness.recorder.windows.len(), 1);
    // The same device with an image that has the packed code.
    harness.board.reboot();
    harness.board.supported = Streams::ALL;
    let hello = harness.board.hello();
    harness.receive(&hello);
    harness.exchange();
    let origins: Vec<&str> = harness.recorder.announced.iter().map(origin).collect();
    assert_eq!(origins, ["packed code", "autoencoder", "packed code"]);
    let mut device = Packed {
        harness,
        next: 0,
        rate: 4,
        flags: link::Flags::empty(),
    };
    device.send(false);
    assert_eq!(device.harness.recorder.blocks.len(), 1);
}

#[test]
fn a_device_that_streams_what_it_is_asked_for_is_announced_once() {
    let device = Packed::new(PACKED);
    assert_eq!(device.harness.recorder.announced.len(), 1);
}

#[test]
fn events_are_shifted_by_the_delay_of_the_stream_that_is_decoded() {
    // Four steps are 31.25 ms, a window of sixteen 125 ms; frames of four steps, group delay 10 ms, 1.5 steps.
    let rest_us = 10_000 - 31_250 + 11_718;
    for (supported, low_latency, steps_us) in [
        // The window that a hop begins is complete 15 steps later; the next block 7 steps later.
        (NETWORK, false, 117_187),
        (Streams::ALL, false, 54_687),
        (NETWORK, true, 23_437),
        (Streams::ALL, true, 23_437),
    ] {
        let mut harness = harness(supported, low_latency);
        let expected_us = steps_us + rest_us;
        assert!((shift_us(&mut harness) - expected_us).abs() <= 2);
        harness.code(1, false);
        let happened_us = harness.now_us + 10_000;
        harness.now_us += 20_000;
        let event = Event {
            kind: EventKind::TriggerRise,
            number: 1,
            sample: 40,
        };
        harness.send(happened_us.unsigned_abs(), &ToHost::Event(event));
        let stamp_ns = harness.recorder.events[0].header.stamp.nanoseconds();
        let shifted_us = (stamp_ns - WALL_START_NS) / 1000 - happened_us;
        assert!(
            (shifted_us - expected_us).abs() <= 2,
            "{shifted_us} {expected_us}"
        );
    }
}
