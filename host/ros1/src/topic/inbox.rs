//! Messages received on one subscribed topic.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::{
    drop_oldest_queue::{DropOldestQueue, Push},
    message_type::MessageType,
};

/// Received messages of a topic from all its publishers, in one queue; also the topic's name and
/// type.
#[derive(Debug)]
pub(crate) struct Inbox {
    /// Full name of the topic.
    pub(crate) topic: String,
    /// Message type that every publisher of the topic must have.
    pub(crate) message_type: &'static MessageType,
    /// Full name of the subscribing node.
    pub(crate) node: String,
    messages: DropOldestQueue<Vec<u8>>,
    dropped: AtomicU64,
}

impl Inbox {
    /// Creates an inbox that holds at most `queue` messages.
    pub(crate) fn new(
        topic: String,
        message_type: &'static MessageType,
        node: &str,
        queue: usize,
    ) -> Self {
        Self {
            topic,
            message_type,
            node: node.to_owned(),
            messages: DropOldestQueue::new(queue),
            dropped: AtomicU64::new(0),
        }
    }

    /// Queues a received message body. Returns false if the inbox is closed.
    pub(crate) fn deliver(&self, message: Vec<u8>) -> bool {
        match self.messages.push(message) {
            Push::Queued => true,
            Push::DroppedOldest => {
                self.dropped.fetch_add(1, Relaxed);
                true
            }
            Push::Closed => false,
        }
    }

    /// Removes and returns the oldest message. Waits while the inbox is empty; returns `None` once
    /// it is closed and empty. Cancelling the wait loses no message.
    pub(crate) async fn recv(&self) -> Option<Vec<u8>> {
        self.messages.pop().await
    }

    /// Number of messages dropped because the queue was full.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Relaxed)
    }

    /// Closes the inbox: no further message is queued, but those already queued can still be
    /// received.
    pub(crate) fn close(&self) {
        self.messages.close();
    }
}
