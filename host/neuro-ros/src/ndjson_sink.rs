//! Writes messages as lines of JSON.

use std::io::Write;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::time::Duration;

use serde::Serialize;

use crate::sink::{Sink, SinkError};

/// Maximum number of queued lines per topic. At 16 lines per second, the queue holds 17 min. This
/// is enough for the fillers that a bridge publishes at once after a long outage.
const QUEUE_LINES: usize = 16_384;
/// Maximum size of the queued lines per topic, bytes. At 16 lines per second, the limit is reached
/// after 17 min of codes (4 KB each) or after 2 min of raw frames (30 KB each). Each topic has a
/// separate limit, so that no topic causes another to drop lines.
const QUEUE_BYTES: usize = 64 << 20;

/// Writes lines of JSON to any output from a separate thread, so that publishing never waits.
///
/// Each message becomes one line: `{"topic":"/encoded","message":{...}}`.
#[derive(Debug)]
pub struct NdjsonWriter {
    lines: Sender<QueuedLine>,
    done: Receiver<std::io::Result<()>>,
    /// Number of lines, of all topics, that the writer thread has not written yet.
    pending: Arc<AtomicUsize>,
}

/// An encoded line on its way to the writer thread. The thread subtracts the line from `usage`, the
/// queue usage of its topic.
#[derive(Debug)]
struct QueuedLine {
    line: Vec<u8>,
    usage: Arc<QueueUsage>,
}

/// Number and total size (bytes) of one topic's queued lines.
#[derive(Debug, Default)]
struct QueueUsage {
    lines: AtomicUsize,
    bytes: AtomicUsize,
}

impl QueueUsage {
    /// Counts a line of `bytes` bytes as queued, unless a limit would be exceeded. Returns whether
    /// the line was counted.
    fn reserve(&self, bytes: usize) -> bool {
        let room = self.lines.load(Ordering::Relaxed) < QUEUE_LINES
            && self.bytes.load(Ordering::Relaxed) + bytes <= QUEUE_BYTES;
        if room {
            self.lines.fetch_add(1, Ordering::Relaxed);
            self.bytes.fetch_add(bytes, Ordering::Relaxed);
        }
        room
    }

    fn release(&self, bytes: usize) {
        self.lines.fetch_sub(1, Ordering::Relaxed);
        self.bytes.fetch_sub(bytes, Ordering::Relaxed);
    }
}

impl NdjsonWriter {
    /// Starts a thread that writes the lines to `output`.
    pub fn start(output: impl Write + Send + 'static) -> NdjsonWriter {
        let (lines, receiver) = channel();
        let (done_sender, done) = sync_channel(1);
        let pending = Arc::new(AtomicUsize::new(0));
        let pending_lines = Arc::clone(&pending);
        std::thread::spawn(move || {
            let outcome = write_lines(output, &receiver, &pending_lines);
            // Sending fails if the `NdjsonWriter` was dropped without calling `finish`.
            let _ = done_sender.send(outcome);
        });
        NdjsonWriter { lines, done, pending }
    }

    /// Creates a sink for the messages of one topic, with a separate queue limit.
    pub fn sink<M>(&self, topic: &str) -> NdjsonSink<M> {
        NdjsonSink {
            topic: topic.to_owned(),
            lines: self.lines.clone(),
            pending: Arc::clone(&self.pending),
            usage: Arc::default(),
            dropped: 0,
            message: PhantomData,
        }
    }

    /// Waits until all sinks have been dropped and all queued lines have been written. Gives up
    /// after `timeout`.
    ///
    /// # Errors
    ///
    /// [`SinkError::Closed`] if the reader has closed the output, [`SinkError::Stuck`] if the time
    /// limit expired, [`SinkError::DiskFull`] or [`SinkError::Output`] if writing failed.
    pub fn finish(self, timeout: Duration) -> Result<(), SinkError> {
        drop(self.lines);
        match self.done.recv_timeout(timeout) {
            Ok(Err(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => {
                Err(SinkError::Closed)
            }
            Ok(Err(error)) if error.kind() == std::io::ErrorKind::StorageFull => {
                Err(SinkError::DiskFull)
            }
            Ok(Err(error)) => Err(SinkError::Output(error)),
            Ok(Ok(())) => Ok(()),
            Err(RecvTimeoutError::Timeout) => {
                Err(SinkError::Stuck(self.pending.load(Ordering::Relaxed)))
            }
            Err(RecvTimeoutError::Disconnected) => Err(SinkError::Closed),
        }
    }
}

fn write_lines(
    mut output: impl Write,
    lines: &Receiver<QueuedLine>,
    pending: &AtomicUsize,
) -> std::io::Result<()> {
    while let Ok(QueuedLine { line, usage }) = lines.recv() {
        usage.release(line.len());
        output.write_all(&line)?;
        output.flush()?;
        pending.fetch_sub(1, Ordering::Relaxed);
    }
    Ok(())
}

/// Sink for the messages of one topic; created by [`NdjsonWriter::sink`].
#[derive(Debug)]
pub struct NdjsonSink<M> {
    topic: String,
    lines: Sender<QueuedLine>,
    pending: Arc<AtomicUsize>,
    usage: Arc<QueueUsage>,
    dropped: u64,
    message: PhantomData<fn(M)>,
}

/// One line of JSON: a message and its topic.
#[derive(Serialize)]
pub struct JsonLine<'a, M> {
    /// Name of the topic, such as `/encoded`.
    pub topic: &'a str,
    /// Device time of the message, microseconds; `None` if `message` has a stamp of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device_time_us: Option<u64>,
    /// Message that was published on the topic.
    pub message: &'a M,
}

impl<M: Serialize> JsonLine<'_, M> {
    /// Returns the line with the line feed at its end.
    ///
    /// # Errors
    ///
    /// If JSON cannot express a number or text of the message.
    pub fn to_bytes(&self) -> std::io::Result<Vec<u8>> {
        let mut line = serde_json::to_vec(self)?;
        line.push(b'\n');
        Ok(line)
    }
}

impl<M: Serialize> Sink<M> for NdjsonSink<M> {
    fn publish(&mut self, message: &M) -> Result<(), SinkError> {
        let line = JsonLine { topic: &self.topic, device_time_us: None, message };
        let line = line.to_bytes()?;
        if !self.usage.reserve(line.len()) {
            self.dropped += 1;
            return Ok(());
        }
        // Count the line before sending it: the thread can write and subtract it at once.
        self.pending.fetch_add(1, Ordering::Relaxed);
        let usage = Arc::clone(&self.usage);
        let sent = self.lines.send(QueuedLine { line, usage });
        sent.map_err(|_| SinkError::Closed)
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }
}
