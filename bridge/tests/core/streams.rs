//! What the device is asked to stream, and what becomes of it when it has not all of it.

use bridge::{AnnouncedStream, Settings};
use link::{Streams, ToDevice};
use neuro_ros::DiagnosticLevel;

use crate::board::Board;
use crate::recorder::{Desk, SETTINGS, commands};

const EVERYTHING: Streams = Streams::ALL;

/// Streams of every start that the board saw, as bits.
fn starts(desk: &Desk) -> Vec<u16> {
    let streams = desk.board.seen.iter().map(|(_, command)| match command {
        ToDevice::Start(start) => Some(start.streams.bits()),
        _ => None,
    });
    streams.flatten().collect()
}

fn desk(streams: Streams, knows: Streams) -> Desk {
    let settings = Settings {
        streams,
        ..SETTINGS
    };
    let mut desk = Desk::new(
        settings,
        Board {
            knows,
            ..Board::new()
        },
    );
    desk.connect();
    desk
}

#[test]
fn the_chosen_streams_go_to_the_device_and_codes_always_do() {
    for (asked, expected) in [(0b11001, 0b11001), (0b00010, 0b00011), (0, 1)] {
        let desk = desk(Streams::from_bits(asked), EVERYTHING);
        assert_eq!(starts(&desk), [expected]);
    }
}

#[test]
fn an_older_device_is_asked_again_for_codes_alone_and_that_is_no_warning() {
    let mut desk = desk(
        Streams::CODES | Streams::AUDIT | Streams::EVENTS,
        Streams::CODES,
    );
    assert_eq!(starts(&desk), [0b11001, 1]);
    desk.code(1, false);
    assert_eq!(desk.core.summary().received, 1);
    let status = desk.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
    assert!(
        status.message.contains("does not stream audit events"),
        "{}",
        status.message
    );
    // What it has refused is not asked for again by each reconnection.
    desk.core.disconnected();
    desk.board.streaming = false;
    desk.connect();
    assert_eq!(starts(&desk), [0b11001, 1, 1]);
}

#[test]
fn a_port_too_slow_for_samples_still_gives_events_and_the_missing_ones_are_a_warning() {
    let mut uart = desk(EVERYTHING, EVERYTHING.without(Streams::RAW));
    assert_eq!(starts(&uart), [0b11111, 0b11101]);
    uart.code(1, false);
    let status = uart.status("device").unwrap();
    assert!(
        status.message.contains("raw: its port"),
        "{}",
        status.message
    );

    let knows = Streams::CODES | Streams::AUDIT | Streams::EVENTS;
    let mut desk = desk(EVERYTHING, knows);
    assert_eq!(starts(&desk), [0b11111, 0b11101, 0b11001]);
    desk.code(1, false);
    let status = desk.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert!(
        status.message.contains("raw filtered"),
        "{}",
        status.message
    );
}

#[test]
fn another_device_is_asked_for_everything_again() {
    let mut desk = desk(EVERYTHING, Streams::CODES);
    desk.board.reboot();
    desk.board.knows = EVERYTHING;
    let hello = desk.board.hello();
    desk.receive(&hello);
    desk.converse();
    assert_eq!(commands(&desk).last(), Some(&"start"));
    assert_eq!(starts(&desk).last(), Some(&0b11111));
    desk.code(1, false);
    assert_eq!(desk.status("device").unwrap().message, "streaming");
}

#[test]
fn every_stream_can_be_announced() {
    for (announced, channels, sr, nsamples) in [
        (AnnouncedStream::Encoded, [128, 0, 8], 16, 1),
        (AnnouncedStream::Reconstructed, [61, 0, 8], 128, 8),
        (AnnouncedStream::Raw, [61, 3, 8], 512, 32),
        (AnnouncedStream::Filtered, [61, 0, 8], 128, 8),
    ] {
        let settings = Settings {
            announced,
            streams: EVERYTHING,
            ..SETTINGS
        };
        let desk = Desk::streaming(settings, Board::new());
        let shape = desk.recorder.announced[0].info.as_ref().unwrap().shape();
        assert_eq!(
            (shape.nchannels, shape.sr, shape.nsamples),
            (channels, sr, nsamples),
            "{announced:?}"
        );
    }
}
