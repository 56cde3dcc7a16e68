//! Edges of the trigger input: they become events on `/events/bus`, and set the trigger level of
//! every sample.

use bridge_core::Settings;
use link::{Event, EventKind, Flags, Streams, ToHost};
use neuro_ros::DiagnosticLevel;

use crate::board::{Board, WALL_START_NS};
use crate::recorder::{Harness, SETTINGS, state, value};
use crate::samples::send_samples_at;

const EVENTS: Settings = Settings { streams: Streams::from_bits(0b10011), ..SETTINGS };

fn event(kind: EventKind, number: u32, sample: u64) -> ToHost<'static> {
    ToHost::Event(Event { kind, number, sample })
}

#[test]
fn an_edge_becomes_an_event_at_its_own_time() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    // The edge happens 10 ms after a code, and the bridge reads its event 20 ms after the edge.
    let happened = harness.now_us.unsigned_abs() + 10_123;
    harness.now_us += 30_000;
    harness.send(happened, &event(EventKind::TriggerRise, 7, 40));
    harness.send(happened + 5_000, &event(EventKind::TriggerFall, 8, 42));
    let [rise, fall] = &harness.recorder.events[..] else {
        panic!("{:?}", harness.recorder.events)
    };
    // A rising edge has the code 1, the first user code in GDF's event table. A falling edge has
    // the same code with the bit 0x8000, which marks the end of an event.
    assert_eq!((rise.event, fall.event), (1, 0x8001));
    assert_eq!((&*rise.description, &*fall.description), ("trigger high", "trigger low"));
    assert_eq!((rise.duration, rise.family, &*rise.version), (0.0, 0, "1"));
    let since = rise.header.stamp.nanoseconds() - WALL_START_NS;
    assert_eq!(since, happened.cast_signed() * 1000);
    assert_eq!(fall.header.stamp.nanoseconds() - rise.header.stamp.nanoseconds(), 5_000_000);
    // The device time published with each event is that of its edge.
    let times = [happened, happened + 5_000].map(Some);
    let places = harness.recorder.places.iter();
    assert!(places.map(|place| place.device_us).eq(times));
}

#[test]
fn lost_events_are_counted_and_reported_once() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    let now = harness.now_us.unsigned_abs();
    for number in [u32::MAX, 0, 4] {
        harness.send(now, &event(EventKind::TriggerRise, number, 0));
    }
    let status = harness.status("loss").unwrap();
    assert_eq!(state(&status), (DiagnosticLevel::Warn, "3 events missing since the last report"));
    assert_eq!(harness.status("loss").unwrap().level, DiagnosticLevel::Ok);
    // Three events are edges, and one states that edges were lost.
    assert_eq!(harness.recorder.events.len(), 4);
    // Neither a replay nor an event of a kind from a later release is published.
    harness.send(now, &event(EventKind::TriggerRise, 4, 0));
    harness.send(now, &event(EventKind::Newer(9), 5, 0));
    assert_eq!(harness.recorder.events.len(), 4);
    let status = harness.status("loss").unwrap();
    assert_eq!(value(&status, "events of unknown kinds"), "1");
}

#[test]
fn every_sample_and_code_carries_the_trigger_level() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    let now = harness.now_us.unsigned_abs();
    harness.send(now, &event(EventKind::TriggerRise, 0, 10));
    harness.send(now, &event(EventKind::TriggerFall, 1, 70));
    for first in [0, 8, 16, 24] {
        harness.now_us += 15_625;
        let now_us = harness.now_us.unsigned_abs();
        send_samples_at(&mut harness, now_us, first, Flags::empty());
    }
    let words = harness.recorder.raw[0].tri.data.chunks(8);
    let levels: Vec<i32> = words.map(|words| words[7]).collect();
    assert_eq!(levels[..10], [0; 10]);
    assert_eq!(levels[10..], [1; 22]);
    // Window 0 ends at ADC sample 60, while the trigger is high; window 1 ends at sample 92, after
    // the falling edge.
    harness.code(1, false);
    harness.code(1, false);
    let level = |frame: usize| harness.recorder.encoded[frame].tri.data[7];
    assert_eq!((level(0), level(1)), (1, 0));
    assert_eq!(harness.recorder.windows[0].words.trigger, 1);
}

#[test]
fn an_event_of_an_impossible_time_is_stamped_with_its_arrival() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    harness.send(u64::MAX, &event(EventKind::TriggerRise, 0, u64::MAX));
    let stamp = harness.recorder.events[0].header.stamp.nanoseconds();
    assert_eq!(stamp, crate::board::at(harness.now_us).wall_ns);
}

#[test]
fn events_before_an_introduction_are_not_published() {
    let mut harness = Harness::new(EVENTS, Board::new());
    harness.open();
    harness.send(0, &event(EventKind::TriggerRise, 0, 0));
    assert!(harness.recorder.events.is_empty());
}

/// Returns the numbers of lost events (`events lost`) and of replayed events (`events behind
/// others`) in `/diagnostics`.
fn figures(harness: &mut Harness) -> [String; 2] {
    ["events lost", "events behind others"].map(|key| harness.figure("loss", key))
}

#[test]
fn event_numbers_that_advance_while_stopped_or_restart_with_a_boot_are_no_loss() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    let rise = |harness: &mut Harness, number| {
        let now = harness.now_us.unsigned_abs();
        harness.send(now, &event(EventKind::TriggerRise, number, 0));
    };
    rise(&mut harness, 1_000);
    harness.set_streaming(false);
    harness.set_streaming(true);
    rise(&mut harness, 1_007);
    harness.reboot(600_000);
    rise(&mut harness, 3);
    assert_eq!(harness.recorder.events.len(), 3);
    assert_eq!(figures(&mut harness), ["0", "0"]);
    // The port is closed and opened again while the device streams on. Events 4 and 5 are lost.
    harness.core.disconnected();
    harness.connect();
    rise(&mut harness, 6);
    rise(&mut harness, 6);
    // Four events are edges, and one states that edges were lost.
    assert_eq!(harness.recorder.events.len(), 5);
    assert_eq!(figures(&mut harness), ["2", "1"]);
}

#[test]
fn a_restart_seen_only_in_the_codes_keeps_the_level_and_loses_no_event() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    let now = harness.now_us.unsigned_abs();
    harness.send(now, &event(EventKind::TriggerRise, 0, 5_000));
    harness.codes(10, 1);
    harness.board.next_window = 0;
    harness.code(1, false);
    let words = &harness.recorder.encoded.last().unwrap().tri.data;
    assert_eq!(words[7], 1, "the level stays: {words:?}");
    let now = harness.now_us.unsigned_abs();
    harness.send(now, &event(EventKind::TriggerFall, 9, 100));
    assert_eq!(figures(&mut harness), ["0", "0"]);
}
