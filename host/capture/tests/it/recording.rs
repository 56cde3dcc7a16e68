//! Recordings have the bytes in docs/recording-format.md. Damage costs only the records it hits.

use std::io::Cursor;

use bridge_core::HostTime;
use capture::{FileHeader, Handshake, LeftOut, RecordKind, Recorder, RecordingReader};
use link::{Decoder, MAX_FRAME, Streams, ToDevice, ToHost};

use crate::board::{Board, at};

const PAGE: &str = include_str!("../../../../docs/recording-format.md");

const HEADER: FileHeader = FileHeader {
    created_ns: 1_700_000_000_000_000_000,
    streams: Streams::from_bits(0b11111),
    mains_hz: 50,
};

/// Returns the bytes of the hex dump `name` in docs/recording-format.md.
fn dump(name: &str) -> Vec<u8> {
    let start = format!("```hex {name}\n");
    let (_, rest) = PAGE.split_once(&start).expect(name);
    let (digits, _) = rest.split_once("```").unwrap();
    let bytes = digits.split_whitespace();
    bytes.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

/// Returns a hex dump as in docs/recording-format.md, for the message of a failed test.
fn printed(bytes: &[u8]) -> String {
    let rows = bytes.chunks(16).map(|row| {
        let row: Vec<String> = row.iter().map(|byte| format!("{byte:02x}")).collect();
        row.join(" ")
    });
    rows.collect::<Vec<String>>().join("\n")
}

fn ping() -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let mut encoder = link::Encoder::default();
    encoder.encode(0, &ToDevice::Ping, &mut buffer).unwrap().to_vec()
}

fn answer() -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let ack = ToHost::Ack(link::Ack { of: 0, result: link::AckResult::Done });
    let mut encoder = link::Encoder::starting_at(300);
    encoder.encode(20_000_000, &ack, &mut buffer).unwrap().to_vec()
}

#[test]
fn the_hex_dumps_of_the_page_are_what_the_recorder_writes() {
    let mut recorder = Recorder::new(HEADER);
    let check = |name, bytes: Vec<u8>| {
        assert_eq!(dump(name), bytes, "{name} is now\n{}", printed(&bytes));
    };
    check("header", recorder.take());
    recorder.opened(at(1_000));
    check("opened", recorder.take());
    recorder.sent(&ping(), at(1_200));
    check("sent", recorder.take());
    recorder.received(&answer(), at(3_400));
    check("received", recorder.take());
    recorder.marker("eyes closed", at(4_000_000));
    check("marker", recorder.take());
    recorder.ending(at(5_000_000));
    check("ending", recorder.take());
    recorder.closed(at(5_100_000));
    check("closed", recorder.take());
}

/// Returns a recording with `frames` frames, and the offsets at which its records end.
fn file(frames: i64) -> (Vec<u8>, Vec<usize>) {
    let mut recorder = Recorder::new(HEADER);
    let mut bytes = recorder.take();
    let mut ends = vec![bytes.len()];
    recorder.opened(at(0));
    for frame in 0..frames {
        bytes.extend(recorder.take());
        ends.push(bytes.len());
        recorder.received(&answer(), at(frame * 1000));
    }
    bytes.extend(recorder.take());
    ends.push(bytes.len());
    (bytes, ends)
}

/// Reads a recording. Returns the times of all records, and the numbers of bytes left out.
fn read(bytes: &[u8]) -> (Vec<HostTime>, LeftOut) {
    let mut reader = RecordingReader::new(Cursor::new(bytes)).unwrap();
    assert_eq!(*reader.header(), HEADER);
    let mut times = Vec::new();
    while let Some(record) = reader.next_record().unwrap() {
        assert!(record.kind == RecordKind::Opened || record.payload == answer());
        times.push(record.time);
    }
    (times, reader.left_out())
}

#[test]
fn a_file_that_is_cut_off_anywhere_is_read_to_its_last_whole_record() {
    let (bytes, ends) = file(20);
    for length in ends[0]..=bytes.len() {
        let (times, left_out) = read(&bytes[..length]);
        let whole = ends.iter().filter(|end| **end <= length).count() - 1;
        assert_eq!(times.len(), whole);
        let at_end = (length - ends[whole]) as u64;
        assert_eq!(left_out, LeftOut { within: 0, at_end });
    }
}

#[test]
fn damage_costs_the_records_that_it_hits() {
    let (bytes, ends) = file(2_000);
    let all = ends.len() - 1;
    for (place, length) in [(ends[7], 1), (ends[7] + 3, 30), (ends[100] - 1, 20_000)] {
        let mut damaged = bytes.clone();
        for byte in &mut damaged[place..place + length] {
            *byte ^= 0x5a;
        }
        let (times, left_out) = read(&damaged);
        let hit = ends.windows(2).filter(|record| record[0] < place + length && record[1] > place);
        let hit: Vec<usize> = hit.map(|record| record[1] - record[0]).collect();
        assert_eq!(times.len(), all - hit.len());
        let within = hit.iter().sum::<usize>() as u64;
        assert_eq!(left_out, LeftOut { within, at_end: 0 });
    }
}

#[test]
fn an_introduction_of_a_silent_device_has_the_device_time_at_the_beginning() {
    let mut handshake = Handshake::default();
    handshake.opened();
    let bytes = Board::new().hello();
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let (mut left, before) = (&bytes[..], HostTime::now());
    while let Some(frame) = decoder.next::<ToHost>(&mut left) {
        handshake.received(&frame.unwrap());
    }
    let mut now = HostTime::now();
    // The board's frames have the device time 0.
    let expected_us = 2_000_000..=2_000_000 + now.monotonic_us - before.monotonic_us;
    now.monotonic_us += 2_000_000;
    now.wall_ns += 2_000_000_000;
    let mut recorder = Recorder::new(HEADER);
    handshake.begin(&mut recorder, now);
    let file = recorder.take();
    let mut reader = RecordingReader::new(&file[..]).unwrap();
    let mut times_us = Vec::new();
    while let Some(record) = reader.next_record().unwrap() {
        assert_eq!(record.time, now);
        let mut payload = record.payload;
        if let Some(frame) = decoder.next::<ToHost>(&mut payload) {
            times_us.push(frame.unwrap().header.device_time_us.cast_signed());
        }
    }
    assert_eq!(times_us.len(), 2);
    for time_us in times_us {
        assert!(expected_us.contains(&time_us), "{time_us}, {expected_us:?}");
    }
}
