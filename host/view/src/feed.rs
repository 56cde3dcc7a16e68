//! The ring of messages between the sinks and the viewers.

use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use neuro_ros::{Sink, SinkError, Wire};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::broadcast::{Receiver, Sender, channel};

/// Number of messages that can wait for a viewer: 10 s of all streams at 50 messages per second. A
/// frame has at most 18 KB (64 channels at 1024 Hz), so the ring takes at most 10 MB, for any
/// number of viewers.
const RING_MESSAGES: usize = 512;
/// Number of bytes before the body of a message: its length (u32), topic (u8) and time (u64).
const HEAD_BYTES: usize = 13;
/// Topic of a message that tells a viewer how many messages it has lost (body: u64).
const DROPPED: u8 = 0;

/// A topic that the page shows. The number is the byte that stands for it in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewTopic {
    /// Codes of the network or the linear map, as NeuroFrames.
    Encoded = 1,
    /// Signals that were decoded from codes or packed blocks, as NeuroFrames.
    Reconstructed = 2,
    /// Filtered steps, as NeuroFrames.
    Filtered = 3,
    /// ADC samples, as NeuroFrames.
    Raw = 4,
    /// Reports, as DiagnosticArrays.
    Diagnostics = 5,
    /// Events, as NeuroEvents. If `frame_id` is `device`, the stamp is the event's device time.
    Events = 6,
}

/// The ring of the newest messages, shared by all sinks and viewers.
///
/// A message is, little-endian: length of the rest (u32), topic (u8), time of publication in
/// microseconds since the page was started (u64), and the message's body in ROS 1 serialisation.
#[derive(Clone, Debug)]
pub(crate) struct Feed {
    ring: Sender<Arc<[u8]>>,
    dropped: Arc<AtomicU64>,
    start: Instant,
}

impl Default for Feed {
    fn default() -> Feed {
        Feed { ring: channel(RING_MESSAGES).0, dropped: Arc::default(), start: Instant::now() }
    }
}

impl Feed {
    pub(crate) fn subscribe(&self) -> Subscription {
        Subscription { feed: self.clone(), messages: self.ring.subscribe() }
    }

    pub(crate) fn viewers(&self) -> usize {
        self.ring.receiver_count()
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Returns a message whose body is what `write` appends.
    fn message(&self, topic: u8, write: impl FnOnce(&mut Vec<u8>)) -> Arc<[u8]> {
        let published_us = u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX);
        let mut message = vec![0; 4];
        message.push(topic);
        message.extend(published_us.to_le_bytes());
        debug_assert_eq!(message.len(), HEAD_BYTES);
        write(&mut message);
        let length = u32::try_from(message.len() - 4).unwrap_or(u32::MAX);
        message[..4].copy_from_slice(&length.to_le_bytes());
        message.into()
    }
}

/// The messages for one viewer.
pub(crate) struct Subscription {
    feed: Feed,
    messages: Receiver<Arc<[u8]>>,
}

impl Subscription {
    /// Waits for the next message. If the viewer was too slow, returns a message with the number of
    /// messages dropped for it. Returns `None` if no further message follows.
    pub(crate) async fn next(&mut self) -> Option<Arc<[u8]>> {
        match self.messages.recv().await {
            Ok(message) => Some(message),
            Err(RecvError::Lagged(count)) => {
                self.feed.dropped.fetch_add(count, Ordering::Relaxed);
                let write = |body: &mut Vec<u8>| body.extend(count.to_le_bytes());
                Some(self.feed.message(DROPPED, write))
            }
            Err(RecvError::Closed) => None,
        }
    }

    /// Counts the message that could not be written, and all that wait, as dropped.
    pub(crate) fn abandon(self) {
        let waiting = self.messages.len() as u64;
        self.feed.dropped.fetch_add(waiting + 1, Ordering::Relaxed);
    }
}

/// Sink for the messages of one topic; created by [`View::sink`](crate::View::sink).
#[derive(Debug)]
pub struct ViewSink<M> {
    feed: Feed,
    topic: ViewTopic,
    message: PhantomData<fn(M)>,
}

impl<M> ViewSink<M> {
    pub(crate) const fn new(feed: Feed, topic: ViewTopic) -> ViewSink<M> {
        ViewSink { feed, topic, message: PhantomData }
    }
}

impl<M: Wire> Sink<M> for ViewSink<M> {
    /// Never fails, even without viewers.
    fn publish(&mut self, message: &M) -> Result<(), SinkError> {
        if self.has_receivers() {
            let topic = self.topic as u8;
            let message = self.feed.message(topic, |body| message.write(body));
            // Sending fails only if the last viewer has just left.
            let _ = self.feed.ring.send(message);
        }
        Ok(())
    }

    /// Returns 0, because the viewers share one ring: [`View::dropped`](crate::View::dropped)
    /// returns the number for all topics.
    fn dropped(&self) -> u64 {
        0
    }

    fn has_receivers(&self) -> bool {
        self.feed.viewers() > 0
    }
}

#[cfg(test)]
mod tests {
    use neuro_ros::UInt8;

    use super::*;

    #[tokio::test]
    async fn a_slow_viewer_loses_the_oldest_messages_and_is_told_how_many() {
        let feed = Feed::default();
        let mut sink = ViewSink::new(feed.clone(), ViewTopic::Diagnostics);
        sink.publish(&UInt8 { data: 9 }).expect("never fails");
        let (mut slow, mut fast) = (feed.subscribe(), feed.subscribe());
        for index in 0..RING_MESSAGES + 3 {
            let [data, ..] = index.to_le_bytes();
            sink.publish(&UInt8 { data }).expect("never fails");
            let message = fast.next().await.expect("a message");
            assert_eq!(message[..5], [10, 0, 0, 0, 5]);
            assert_eq!(message[HEAD_BYTES..], [data]);
        }
        let lost = slow.next().await.expect("the number of lost messages");
        assert_eq!(lost[4], DROPPED);
        assert_eq!(lost[HEAD_BYTES..], 3_u64.to_le_bytes());
        let first = slow.next().await.expect("the oldest message left");
        assert_eq!(first[HEAD_BYTES..], [3]);
        assert_eq!((feed.viewers(), feed.dropped()), (2, 3));
    }
}
