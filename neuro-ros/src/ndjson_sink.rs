//! Messages as lines of JSON.

use std::io::Write;
use std::marker::PhantomData;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use serde::Serialize;

use crate::{Sink, SinkError};

/// Lines that may wait for a slow output: 64 s of codes at 16 Hz.
const QUEUE_LINES: usize = 1024;

/// Writes lines of JSON to any output, from a thread of its own, so that publishing never waits.
///
/// One line per message: `{"topic":"/encoded","message":{...}}`.
#[derive(Debug)]
pub struct NdjsonWriter {
    lines: SyncSender<Vec<u8>>,
    thread: JoinHandle<std::io::Result<()>>,
}

impl NdjsonWriter {
    /// Start writing to `output`.
    pub fn start(output: impl Write + Send + 'static) -> NdjsonWriter {
        let (lines, receiver) = sync_channel(QUEUE_LINES);
        let thread = std::thread::spawn(move || write_lines(output, &receiver));
        NdjsonWriter { lines, thread }
    }

    /// A sink for the messages of one topic.
    pub fn sink<M>(&self, topic: &str) -> NdjsonSink<M> {
        NdjsonSink {
            topic: topic.to_owned(),
            lines: self.lines.clone(),
            dropped: 0,
            message: PhantomData,
        }
    }

    /// Write what is left, once the sinks are gone, and end.
    ///
    /// # Errors
    ///
    /// What stopped the output, [`SinkError::Closed`] if its reader had gone.
    pub fn finish(self) -> Result<(), SinkError> {
        drop(self.lines);
        match self.thread.join() {
            Ok(Err(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => {
                Err(SinkError::Closed)
            }
            Ok(Err(error)) => Err(SinkError::Output(error)),
            Ok(Ok(())) => Ok(()),
            Err(_) => Err(SinkError::Closed),
        }
    }
}

fn write_lines(mut output: impl Write, lines: &Receiver<Vec<u8>>) -> std::io::Result<()> {
    while let Ok(line) = lines.recv() {
        output.write_all(&line)?;
        output.flush()?;
    }
    Ok(())
}

/// Messages of one topic as lines of JSON.
#[derive(Debug)]
pub struct NdjsonSink<M> {
    topic: String,
    lines: SyncSender<Vec<u8>>,
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
        match self.lines.try_send(line) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(_)) => {
                self.dropped += 1;
                Ok(())
            }
            Err(TrySendError::Disconnected(_)) => Err(SinkError::Closed),
        }
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }
}
