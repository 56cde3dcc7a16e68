//! Messages as lines of JSON.

use std::io::Write;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::time::Duration;

use serde::Serialize;

use crate::{Sink, SinkError};

/// Lines of one topic that may wait for a slow output: 17 min at 16 Hz, so that even the fillers of
/// a long outage, which come at once, are all written.
const QUEUE_LINES: usize = 16_384;
/// Bytes of one topic that may wait: 17 min of codes, 4 KB each, and 2 min of raw samples, 30 KB
/// each. Every topic has its own, so that none costs another one a line.
const QUEUE_BYTES: usize = 64 << 20;

/// Writes lines of JSON to any output, from a thread of its own, so that publishing never waits.
///
/// One line per message: `{"topic":"/encoded","message":{...}}`.
#[derive(Debug)]
pub struct NdjsonWriter {
    lines: Sender<Waiting>,
    done: Receiver<std::io::Result<()>>,
    waiting: Arc<AtomicUsize>,
}

/// A line, and the queue of its topic.
#[derive(Debug)]
struct Waiting {
    line: Vec<u8>,
    queue: Arc<Queue>,
}

/// What waits of one topic.
#[derive(Debug, Default)]
struct Queue {
    lines: AtomicUsize,
    bytes: AtomicUsize,
}

impl Queue {
    /// Whether a line finds room; then it has taken it.
    fn enter(&self, bytes: usize) -> bool {
        let room = self.lines.load(Ordering::Relaxed) < QUEUE_LINES
            && self.bytes.load(Ordering::Relaxed) + bytes <= QUEUE_BYTES;
        if room {
            self.lines.fetch_add(1, Ordering::Relaxed);
            self.bytes.fetch_add(bytes, Ordering::Relaxed);
        }
        room
    }

    fn leave(&self, bytes: usize) {
        self.lines.fetch_sub(1, Ordering::Relaxed);
        self.bytes.fetch_sub(bytes, Ordering::Relaxed);
    }
}

impl NdjsonWriter {
    /// Start writing to `output`.
    pub fn start(output: impl Write + Send + 'static) -> NdjsonWriter {
        let (lines, receiver) = channel();
        let (done_in, done) = sync_channel(1);
        let waiting = Arc::new(AtomicUsize::new(0));
        let left = Arc::clone(&waiting);
        std::thread::spawn(move || {
            let outcome = write_lines(output, &receiver, &left);
            // An error means that nobody waits for the end any more.
            let _ = done_in.send(outcome);
        });
        NdjsonWriter {
            lines,
            done,
            waiting,
        }
    }

    /// A sink for the messages of one topic.
    pub fn sink<M>(&self, topic: &str) -> NdjsonSink<M> {
        NdjsonSink {
            topic: topic.to_owned(),
            lines: self.lines.clone(),
            waiting: Arc::clone(&self.waiting),
            queue: Arc::default(),
            dropped: 0,
            message: PhantomData,
        }
    }

    /// Write what is left, once the sinks are gone, and end. Gives up after `patience`.
    ///
    /// # Errors
    ///
    /// What stopped the output: [`SinkError::Closed`] if its reader had gone,
    /// [`SinkError::Stuck`] if it has not taken everything in time.
    pub fn finish(self, patience: Duration) -> Result<(), SinkError> {
        drop(self.lines);
        match self.done.recv_timeout(patience) {
            Ok(Err(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => {
                Err(SinkError::Closed)
            }
            Ok(Err(error)) => Err(SinkError::Output(error)),
            Ok(Ok(())) => Ok(()),
            Err(RecvTimeoutError::Timeout) => Err(SinkError::Stuck {
                lines: self.waiting.load(Ordering::Relaxed),
            }),
            Err(RecvTimeoutError::Disconnected) => Err(SinkError::Closed),
        }
    }
}

fn write_lines(
    mut output: impl Write,
    lines: &Receiver<Waiting>,
    waiting: &AtomicUsize,
) -> std::io::Result<()> {
    while let Ok(Waiting { line, queue }) = lines.recv() {
        queue.leave(line.len());
        output.write_all(&line)?;
        output.flush()?;
        waiting.fetch_sub(1, Ordering::Relaxed);
    }
    Ok(())
}

/// Messages of one topic as lines of JSON.
#[derive(Debug)]
pub struct NdjsonSink<M> {
    topic: String,
    lines: Sender<Waiting>,
    waiting: Arc<AtomicUsize>,
    queue: Arc<Queue>,
    dropped: u64,
    message: PhantomData<fn(M)>,
}

#[derive(Serialize)]
struct Line<'a, M> {
    topic: &'a str,
    message: &'a M,
}

impl<M: Serialize> Sink<M> for NdjsonSink<M> {
    fn publish(&mut self, message: &M) -> Result<(), SinkError> {
        let mut line = serde_json::to_vec(&Line {
            topic: &self.topic,
            message,
        })
        .map_err(std::io::Error::from)?;
        line.push(b'\n');
        if !self.queue.enter(line.len()) {
            self.dropped += 1;
            return Ok(());
        }
        // Counted before it can be written.
        self.waiting.fetch_add(1, Ordering::Relaxed);
        let queue = Arc::clone(&self.queue);
        let sent = self.lines.send(Waiting { line, queue });
        sent.map_err(|_| SinkError::Closed)
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }
}
