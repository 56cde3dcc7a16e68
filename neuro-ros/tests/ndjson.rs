//! Lines of JSON: whole, in order, and never in the publisher's way.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

use std::io::{self, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use neuro_ros::{NdjsonWriter, NeuroFrame, Sink, SinkError};

/// How long an output may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

/// Hands every write to the test.
struct Probe(Sender<Vec<u8>>);

impl Write for Probe {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0
            .send(bytes.to_vec())
            .map_err(|_| io::Error::from(io::ErrorKind::BrokenPipe))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// An output that takes nothing until it is told.
struct Stuck(Receiver<()>);

impl Write for Stuck {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = self.0.recv();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn frames_become_lines_in_order() {
    let (probe, written) = channel();
    let writer = NdjsonWriter::start(Probe(probe));
    let mut sink = writer.sink("/encoded");
    for seq in 1..=3 {
        let mut frame = NeuroFrame::default();
        frame.neuroheader.seq = seq;
        frame.eeg.data = vec![0.5, -1.25];
        sink.publish(&frame).unwrap();
    }
    drop(sink);
    writer.finish(PATIENCE).unwrap();
    let text = String::from_utf8(written.iter().flatten().collect()).unwrap();
    let lines: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 3);
    for (line, seq) in lines.iter().zip(1..) {
        assert_eq!(line["topic"], "/encoded");
        assert_eq!(line["message"]["neuroheader"]["seq"], seq);
        assert_eq!(line["message"]["eeg"]["data"][1], -1.25);
    }
}

#[test]
fn an_output_that_takes_nothing_costs_lines_but_never_time() {
    let (release, stuck) = channel();
    let writer = NdjsonWriter::start(Stuck(stuck));
    let mut sink = writer.sink("/encoded");
    for _ in 0..17_000 {
        sink.publish(&NeuroFrame::default()).unwrap();
    }
    // 16,384 wait, one may be with the output; the others are counted.
    assert!((615..=616).contains(&sink.dropped()), "{}", sink.dropped());
    let kept = 17_000 - sink.dropped();
    drop(sink);
    let end = writer.finish(Duration::from_millis(50));
    assert!(matches!(end, Err(SinkError::Stuck { lines }) if lines as u64 == kept));
    drop(release);
}

#[test]
fn a_topic_of_large_lines_takes_no_room_from_another_one() {
    let (release, stuck) = channel();
    let writer = NdjsonWriter::start(Stuck(stuck));
    let (mut raw, mut encoded) = (writer.sink("/neurodata"), writer.sink("/encoded"));
    let mut large = NeuroFrame::default();
    // 11 bytes each: 1.1 MB a line.
    large.eeg.data = vec![0.123_456_79; 100_000];
    for _ in 0..70 {
        raw.publish(&large).unwrap();
    }
    // 64 MiB wait, one may be with the output.
    assert!((8..=13).contains(&raw.dropped()), "{}", raw.dropped());
    for _ in 0..10_000 {
        encoded.publish(&NeuroFrame::default()).unwrap();
    }
    assert_eq!(encoded.dropped(), 0);
    drop((raw, encoded, release));
    writer.finish(PATIENCE).unwrap();
}

#[test]
fn a_reader_that_has_gone_ends_the_sink() {
    let (probe, written) = channel();
    drop(written);
    let writer = NdjsonWriter::start(Probe(probe));
    let mut sink = writer.sink("/encoded");
    while sink.publish(&NeuroFrame::default()).is_ok() {
        std::thread::yield_now();
    }
    drop(sink);
    assert!(matches!(writer.finish(PATIENCE), Err(SinkError::Closed)));
}

#[test]
fn the_fillers_of_a_long_outage_are_all_written() {
    let (probe, written) = channel();
    let writer = NdjsonWriter::start(Probe(probe));
    let mut sink = writer.sink("/encoded");
    for _ in 0..10_000 {
        sink.publish(&NeuroFrame::default()).unwrap();
    }
    assert_eq!(sink.dropped(), 0);
    drop(sink);
    writer.finish(PATIENCE).unwrap();
    assert_eq!(written.iter().count(), 10_000);
}
