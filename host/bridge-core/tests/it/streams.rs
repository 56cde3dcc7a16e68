//! Streams that `Start` asks the device for, and devices that refuse some of them.

use bridge_core::{AnnouncedStream, RawForm, Settings};
use link::{Streams, ToDevice};
use neuro_ros::DiagnosticLevel;

use crate::board::{Board, assert_has};
use crate::recorder::{Harness, SETTINGS, commands, state};

/// All streams of releases that have no packed blocks.
const EVERYTHING: Streams = Streams::from_bits(0b11_1111);

/// Returns the stream bits of every `Start` that the board received, oldest first.
fn starts(harness: &Harness) -> Vec<u16> {
    let received = harness.board.received.iter();
    let streams = received.filter_map(|(_, command)| match command {
        ToDevice::Start(start) => Some(start.streams.bits()),
        _ => None,
    });
    streams.collect()
}

fn harness(streams: Streams, supported: Streams) -> Harness {
    let settings = Settings { streams, ..SETTINGS };
    Harness::connected(settings, Board::supporting(supported))
}

#[test]
fn the_device_is_asked_for_the_chosen_streams_and_for_codes_unless_for_packed_blocks() {
    for (asked, expected) in [
        (0b01_1001, 0b01_1001),
        (0b00_0010, 0b00_0011),
        (0b10_0000, 0b10_0001),
        // If packed blocks are wanted, the bridge does not add codes.
        (0b100_1000, 0b100_1000),
        (0b100_0001, 0b100_0001),
        // If samples may have either form, the bridge asks for plain ones first.
        (0b10_0010, 0b00_0011),
        (0, 1),
    ] {
        let harness = harness(Streams::from_bits(asked), Streams::ALL);
        assert_eq!(starts(&harness), [expected]);
    }
}

#[test]
fn an_older_device_is_asked_for_codes_alone_without_a_warning() {
    let mut harness = harness(Streams::CODES | Streams::AUDIT | Streams::EVENTS, Streams::CODES);
    assert_eq!(starts(&harness), [0b11001, 1]);
    harness.code(1, false);
    assert_eq!(harness.core.summary().received, 1);
    let status = harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
    assert_has(&status.message, ["does not stream audit events"]);
    // After a reconnection, the core does not ask for the refused streams again.
    harness.core.disconnected();
    harness.board.streaming = false;
    harness.connect();
    assert_eq!(starts(&harness), [0b11001, 1, 1]);
}

#[test]
fn a_device_whose_port_is_too_slow_is_asked_for_compressed_samples() {
    let uart = EVERYTHING.without(Streams::RAW);
    let mut harness = harness(EVERYTHING, uart);
    assert_eq!(starts(&harness), [0b01_1111, 0b11_1101]);
    harness.code(1, false);
    let status = harness.status("device").unwrap();
    assert_eq!(state(&status), (DiagnosticLevel::Ok, "streaming"));
    // An older device, which accepts plain samples, is not asked for compressed ones.
    let older = self::harness(EVERYTHING, Streams::from_bits(0b11111));
    assert_eq!(starts(&older), [0b01_1111]);
    // If the user wants only the compressed form, the same device causes a warning.
    let wanted = EVERYTHING.without(Streams::RAW);
    let mut forced = self::harness(wanted, Streams::from_bits(0b11111));
    assert_eq!(starts(&forced), [0b11_1101, 0b01_1101]);
    forced.code(1, false);
    let status = forced.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert_has(&status.message, ["compressed-raw: update"]);
}

#[test]
fn packed_blocks_are_asked_for_without_the_network_and_codes_in_their_place() {
    let wanted = Streams::PACKED | Streams::AUDIT | Streams::EVENTS;
    // A device whose image has the packed code but no network.
    let alone = wanted | Streams::FILTERED;
    let with_filtered = harness(alone | Streams::CODES, alone);
    assert_eq!(starts(&with_filtered), [0b101_1101, 0b101_1001, 0b101_1100]);
    // If the user wants codes too, the refusal of codes causes a warning.
    let mut without_codes = harness(wanted | Streams::CODES, alone);
    let status = without_codes.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert_has(&status.message, ["has no network; choose packed"]);
    // A device whose image has the network but no packed code, or whose firmware is older.
    let mut network = harness(wanted, EVERYTHING);
    assert_eq!(starts(&network), [0b101_1000, 0b001_1001]);
    network.code(1, false);
    let status = network.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert_has(&status.message, ["does not stream packed"]);
    assert_eq!(network.recorder.windows.len(), 1, "codes are decoded");
    // The oldest firmware has no stream but codes.
    assert_eq!(starts(&harness(wanted, Streams::CODES)), [0b101_1000, 0b001_1001, 1]);
}

#[test]
fn a_device_without_packed_blocks_still_streams_the_samples_that_are_wanted() {
    let wanted = Streams::PACKED | RawForm::Any.streams();
    // A device whose image has the network but no packed code, on a USB port.
    let usb = harness(wanted, EVERYTHING);
    assert_eq!(starts(&usb), [0b100_0010, 0b110_0000, 0b100_0000, 0b000_0011]);
    // The same device on a UART, which is too slow for plain samples.
    let uart = harness(wanted, EVERYTHING.without(Streams::RAW));
    assert_eq!(starts(&uart).last(), Some(&0b010_0001));
    // A device that supports packed blocks but no samples keeps streaming the blocks.
    let slow = harness(wanted, Streams::CODES | Streams::PACKED);
    assert_eq!(starts(&slow), [0b100_0010, 0b110_0000, 0b100_0000]);
}

#[test]
fn refused_samples_are_a_warning_and_the_other_streams_still_start() {
    let without_samples = EVERYTHING.without(RawForm::Any.streams());
    let mut uart = harness(EVERYTHING, without_samples);
    assert_eq!(starts(&uart), [0b01_1111, 0b11_1101, 0b01_1101]);
    uart.code(1, false);
    let status = uart.status("device").unwrap();
    assert_has(&status.message, ["raw: its port"]);

    let supported = Streams::CODES | Streams::AUDIT | Streams::EVENTS;
    let mut harness = harness(EVERYTHING, supported);
    assert_eq!(starts(&harness), [0b01_1111, 0b11_1101, 0b01_1101, 0b01_1001]);
    harness.code(1, false);
    let status = harness.status("device").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert_has(&status.message, ["raw filtered"]);
}

#[test]
fn another_device_is_asked_for_all_streams_again() {
    let mut harness = harness(EVERYTHING, Streams::CODES);
    harness.board.supported = EVERYTHING;
    harness.reboot(0);
    assert_eq!(commands(&harness).last(), Some(&"start"));
    assert_eq!(starts(&harness).last(), Some(&0b01_1111));
    harness.code(1, false);
    assert_eq!(harness.status("device").unwrap().message, "streaming");
}

#[test]
fn every_stream_can_be_announced() {
    for (announced, channels, sr, nsamples) in [
        (AnnouncedStream::Encoded, [128, 0, 8], 16, 1),
        (AnnouncedStream::Reconstructed, [61, 0, 8], 128, 8),
        (AnnouncedStream::Raw, [61, 3, 8], 512, 32),
        (AnnouncedStream::Filtered, [61, 0, 8], 128, 8),
    ] {
        let settings = Settings { announced, streams: EVERYTHING, ..SETTINGS };
        let harness = Harness::streaming(settings, Board::new());
        let shape = harness.recorder.announced[0].info.as_ref().unwrap().shape();
        assert_eq!(
            (shape.nchannels, shape.sr, shape.nsamples),
            (channels, sr, nsamples),
            "{announced:?}"
        );
    }
}
