//! Events on the bus, and what they state about missing data.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "times of seconds"
)]

use bridge_core::{EventStamps, Settings};
use link::{Converters, Event, EventKind, Flags, Streams, ToHost};
use neuro_ros::NeuroEvent;

use crate::board::{Board, WALL_START_NS};
use crate::recorder::{Harness, SETTINGS};
use crate::samples::send_samples_at;

const EVENTS: Settings = Settings {
    streams: Streams::from_bits(0b10111),
    event_stamps: EventStamps::Recorder,
    ..SETTINGS
};

#[test]
fn the_shift_of_each_topic_is_in_the_diagnostics() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    // Window of 16 steps, hop of 8, group delay 10 ms. Each frame is 62.5 ms long. The last number
    // in a sum is 1.5 samples: 93.75 ms of codes, 11.7 ms of steps, 2.9 ms of ADC samples.
    for (topic, shift_us) in [
        ("encoded", 117_187 + 10_000 - 62_500 + 93_750),
        ("neurodata_reconstructed", 117_187 + 10_000 - 62_500 + 11_719),
        ("neurodata", 60_546 - 62_500 + 2_930),
        ("neurodata_corticode", 54_687 + 10_000 - 62_500 + 11_719),
    ] {
        let key = format!("recorder shift us /{topic}");
        assert_eq!(harness.figure("device", &key), shift_us.to_string(), "{key}");
    }
}

/// Returns code, duration (seconds) and stamp (microseconds since the start) of each event.
fn events(harness: &Harness) -> Vec<(i32, f32, i64)> {
    let events = harness.recorder.events.iter();
    let of = |event: &NeuroEvent| {
        let stamp_us = (event.header.stamp.nanoseconds() - WALL_START_NS) / 1000;
        (event.event, event.duration, stamp_us)
    };
    events.map(of).collect()
}

#[test]
fn lost_codes_and_restarts_are_events_where_their_fillers_begin() {
    let settings = Settings { event_stamps: EventStamps::Scalp, ..EVENTS };
    let mut harness = Harness::streaming(settings, Board::new());
    for lost in [false, true, true, false] {
        harness.code(1, lost);
    }
    harness.reboot(1_000_000);
    harness.code(1, false);
    let fillers = harness.fillers();
    let begins: Vec<i64> = (1..fillers.len())
        .filter(|&at| fillers[at] && !fillers[at - 1])
        .map(|at| (harness.recorder.encoded[at].header.stamp.nanoseconds() - WALL_START_NS) / 1000)
        .collect();
    assert_eq!(events(&harness), [(0x7f01, 0.125, begins[0]), (0x7ffe, 1.0, begins[1])]);
    let description = &harness.recorder.events[1].description;
    assert_eq!(description, "device restarted: 1.000 s");
}

#[test]
fn samples_lost_in_another_stream_than_the_announced_one_are_no_event() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    for first in [0, 64] {
        harness.now_us += 125_000;
        let device_us = harness.now_us.cast_unsigned();
        send_samples_at(&mut harness, device_us, first, Flags::empty());
    }
    assert_eq!(events(&harness), []);
    harness.code(1, false);
}

#[test]
fn lost_edges_electrodes_without_contact_and_refused_devices_are_events() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.code(1, false);
    let now = harness.now_us as u64;
    for number in [0, 3] {
        let edge = Event { kind: EventKind::TriggerRise, number, sample: 0 };
        harness.send(now, &ToHost::Event(edge));
    }
    for off_positive in [0, 0b101, 0b101, 0b1, 0] {
        let converters = Converters { off_positive, ..Converters::default() };
        harness.send(now, &ToHost::Converters(converters));
    }
    harness.core.disconnected();
    harness.board = Board::of_another_shape();
    harness.connect();
    let codes: Vec<i32> = events(&harness).iter().map(|(code, ..)| *code).collect();
    assert_eq!(codes, [1, 0x7f02, 1, 0x105, 0x105, 0x8105, 0x7f03]);
    let text = |at: usize| &harness.recorder.events[at].description;
    assert_eq!(text(1), "trigger edges lost: 2");
    let labels = crate::board::model().electrodes().to_vec();
    assert_eq!(*text(3), format!("electrodes off: {} {}", labels[0], labels[2]));
    assert!(text(6).contains("rate and window"), "{}", text(6));
}
