//! The handle of a subscribed topic.

use std::sync::Arc;

use super::lease::Lease;
use crate::topic::subscription::Subscription;

/// Handle of a topic that this node subscribes to; receives from all publishers of the topic.
/// Dropping the handle unsubscribes.
#[derive(Debug)]
pub struct Subscriber {
    subscription: Arc<Subscription>,
    _lease: Lease,
}

impl Subscriber {
    pub(crate) fn new(subscription: Arc<Subscription>, lease: Lease) -> Self {
        Self {
            subscription,
            _lease: lease,
        }
    }

    /// Returns the next message body. Waits while the queue is empty; returns `None` once the node
    /// has shut down and the queue is empty. Cancelling the wait loses no message.
    pub async fn recv(&mut self) -> Option<Vec<u8>> {
        self.subscription.inbox.recv().await
    }

    /// Number of messages dropped because the queue was full when a newer one arrived.
    pub fn dropped(&self) -> u64 {
        self.subscription.inbox.dropped()
    }

    /// Number of publishers with an open connection.
    pub fn publishers(&self) -> usize {
        self.subscription
            .links()
            .iter()
            .filter(|link| link.is_connected())
            .count()
    }

    /// Full name of the topic after remapping.
    pub fn topic(&self) -> &str {
        &self.subscription.inbox.topic
    }
}
