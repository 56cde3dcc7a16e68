//! Where the acquisition's frames come from: a topic, or a stream of the Lab Streaming Layer.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bridge_core::HostTime;
use lsl::{InletOptions, Library, Received};
use neuro_ros::ros1::Subscriber;
use neuro_ros::{NeuroFrame, Wire};
use tokio::sync::mpsc;
use tokio::sync::mpsc::error::TrySendError;

use crate::refusal::Refusal;

/// Number of frames of a stream that can wait for this program: 64 s at 16 frames per second.
const QUEUE_FRAMES: usize = 1024;

/// The frames of the acquisition.
pub(crate) enum Frames {
    Topic(Subscriber),
    Stream(StreamFrames),
}

/// The frames into which a thread divides a stream of the Lab Streaming Layer.
pub(crate) struct StreamFrames {
    name: String,
    received: mpsc::Receiver<Received>,
    /// Number of streams that matched in the last search.
    matching: usize,
    dropped: Arc<AtomicU64>,
}

impl Frames {
    /// Receives a stream in a new thread.
    ///
    /// # Errors
    ///
    /// The operating system's error if no thread can be started.
    pub(crate) fn from_stream(library: Library, options: InletOptions) -> io::Result<Frames> {
        let (sender, received) = mpsc::channel(QUEUE_FRAMES);
        let name = format!("lsl:{}", options.query.join("="));
        let dropped = Arc::<AtomicU64>::default();
        let count = Arc::clone(&dropped);
        let thread = std::thread::Builder::new().name("lsl inlet".to_owned());
        thread.spawn(move || {
            lsl::receive(library, &options, |received| match sender.try_send(received) {
                Ok(()) => true,
                Err(TrySendError::Full(lost)) => {
                    count.fetch_add(
                        u64::from(matches!(lost, Received::Frame(..))),
                        Ordering::Relaxed,
                    );
                    true
                }
                Err(TrySendError::Closed(_)) => false,
            });
        })?;
        Ok(Frames::Stream(StreamFrames { name, received, matching: 0, dropped }))
    }

    /// Waits for the next frame. Returns it with the time at which its last sample was made, or, if
    /// that time is unknown, with the time of the frame's arrival. Returns an error if a frame
    /// cannot be used, and `None` if no further frame follows. Dropping the future loses no frame.
    pub(crate) async fn recv(&mut self) -> Option<Result<(NeuroFrame, HostTime), Refusal>> {
        match self {
            Frames::Topic(subscriber) => {
                let body = subscriber.recv().await?;
                // Read the clock before the frame is decoded: this is the time of its arrival.
                let read = HostTime::now();
                Some(match (NeuroFrame::from_bytes(&body), subscriber.publishers()) {
                    (Ok(_), publishers @ 2..) => Err(Refusal::Mixed(publishers)),
                    (frame, _) => frame.map(|frame| (frame, read)).map_err(Refusal::from),
                })
            }
            Frames::Stream(stream) => loop {
                match stream.received.recv().await? {
                    Received::Frame(frame, made) => {
                        stream.matching = 1;
                        return Some(Ok((*frame, made)));
                    }
                    Received::Matching(count) => stream.matching = count,
                    Received::Refused(error) => return Some(Err(error.into())),
                }
            },
        }
    }

    /// Returns the name of the topic, or of the stream.
    pub(crate) fn name(&self) -> &str {
        match self {
            Frames::Topic(subscriber) => subscriber.topic(),
            Frames::Stream(stream) => &stream.name,
        }
    }

    /// Returns how many nodes publish the topic, or how many streams match.
    pub(crate) fn publishers(&self) -> usize {
        match self {
            Frames::Topic(subscriber) => subscriber.publishers(),
            Frames::Stream(stream) => stream.matching,
        }
    }

    /// Returns the publishers that cannot be reached: URI, reason and remedy of each.
    pub(crate) fn unreachable(&self) -> Vec<String> {
        match self {
            Frames::Topic(subscriber) => subscriber.unreachable(),
            Frames::Stream(_) => Vec::new(),
        }
    }

    /// Returns the number of frames dropped because this program did not read them in time.
    pub(crate) fn dropped(&self) -> u64 {
        match self {
            Frames::Topic(subscriber) => subscriber.dropped(),
            Frames::Stream(stream) => stream.dropped.load(Ordering::Relaxed),
        }
    }
}
