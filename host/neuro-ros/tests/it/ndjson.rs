//! Lines of JSON are complete and in order, and never block the publisher.

use std::io::{self, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use neuro_ros::{NdjsonWriter, NeuroFrame, Sink, SinkError};

/// Time limit of each wait: far longer than any operation takes, even on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(30);

/// An output that passes every written piece to the test over a channel.
struct ChannelOutput(Sender<Vec<u8>>);

impl Write for ChannelOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.send(bytes.to_vec()).map_err(|_| io::Error::from(io::ErrorKind::BrokenPipe))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// An output whose writes block until the sender of its channel is dropped.
struct BlockedOutput(Receiver<()>);

impl Write for BlockedOutput {
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
    let (output, written) = channel();
    let writer = NdjsonWriter::start(ChannelOutput(output));
    let mut sink = writer.sink("/encoded");
    for seq in 1..=3 {
        let mut frame = NeuroFrame::default();
        frame.neuroheader.seq = seq;
        frame.eeg.data = vec![0.5, -1.25];
        sink.publish(&frame).unwrap();
    }
    drop(sink);
    writer.finish(TIMEOUT).unwrap();
    let text = String::from_utf8(written.iter().flatten().collect()).unwrap();
    let lines: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 3);
    for (line, seq) in lines.iter().zip(1..) {
        assert_eq!(line["topic"], "/encoded");
        assert_eq!(line["message"]["neuroheader"]["seq"], seq);
        assert_eq!(line["message"]["eeg"]["data"][1], -1.25);
    }
}

#[test]
fn a_blocked_output_loses_lines_but_never_blocks_publishing() {
    let (release, blocked) = channel();
    let writer = NdjsonWriter::start(BlockedOutput(blocked));
    let mut sink = writer.sink("/encoded");
    for _ in 0..17_000 {
        sink.publish(&NeuroFrame::default()).unwrap();
    }
    // Of 17,000 lines, 16,384 fit in the queue and the blocked output can have taken one more, so
    // 615 or 616 are dropped.
    assert!((615..=616).contains(&sink.dropped()), "{}", sink.dropped());
    let kept = 17_000 - sink.dropped();
    drop(sink);
    let end = writer.finish(Duration::from_millis(50));
    assert!(matches!(end, Err(SinkError::Stuck(lines)) if lines as u64 == kept));
    drop(release);
}

#[test]
fn large_lines_of_one_topic_do_not_displace_lines_of_another() {
    let (release, blocked) = channel();
    let writer = NdjsonWriter::start(BlockedOutput(blocked));
    let (mut raw, mut encoded) = (writer.sink("/neurodata"), writer.sink("/encoded"));
    let mut large = NeuroFrame::default();
    // Each value takes 11 bytes (`0.12345679,`), so a line has 1.1 MB.
    large.eeg.data = vec![0.123_456_79; 100_000];
    for _ in 0..70 {
        raw.publish(&large).unwrap();
    }
    // About 60 of the 70 lines fit in the queue of 64 MiB, and the blocked output can have taken
    // one more.
    assert!((8..=13).contains(&raw.dropped()), "{}", raw.dropped());
    for _ in 0..10_000 {
        encoded.publish(&NeuroFrame::default()).unwrap();
    }
    // A burst of 10,000 lines of the other topic is queued completely.
    assert_eq!(encoded.dropped(), 0);
    drop((raw, encoded, release));
    writer.finish(TIMEOUT).unwrap();
}

#[test]
fn a_closed_output_ends_the_sink() {
    let (output, written) = channel();
    drop(written);
    let writer = NdjsonWriter::start(ChannelOutput(output));
    let mut sink = writer.sink("/encoded");
    while sink.publish(&NeuroFrame::default()).is_ok() {
        std::thread::yield_now();
    }
    drop(sink);
    assert!(matches!(writer.finish(TIMEOUT), Err(SinkError::Closed)));
}
