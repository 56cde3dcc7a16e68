//! The handles of a node's topics and services. Dropping a handle unregisters its topic or service.

use std::sync::{Arc, Weak, atomic::Ordering::Relaxed};

use super::{graph::Key, registrar::Registrar};
use crate::{
    publication::{Publication, SubscriberLag},
    subscription::Subscription,
};

/// Keeps one topic or service in the node's graph. Dropping the lease removes the topic or service
/// from the graph and unregisters it.
#[derive(Debug)]
pub(crate) struct Lease {
    pub(super) key: Key,
    pub(super) registrar: Weak<Registrar>,
}

impl Drop for Lease {
    fn drop(&mut self) {
        if let Some(registrar) = self.registrar.upgrade() {
            registrar.release(&self.key);
        }
    }
}

/// Handle of a topic that this node publishes. All clones publish on the same topic; dropping the
/// last clone unregisters the topic.
#[derive(Debug, Clone)]
pub struct Publisher {
    pub(super) publication: Arc<Publication>,
    pub(super) _lease: Arc<Lease>,
}

impl Publisher {
    /// Queues one message body for every subscriber, without waiting. Returns the number of
    /// subscribers, or 0 if the body was too long.
    ///
    /// All subscriber queues share one copy of the body; without subscribers no memory is
    /// allocated. A full queue drops its oldest message. A body longer than
    /// [`MAX_MESSAGE`](crate::tcpros::MAX_MESSAGE) is dropped for all subscribers.
    /// [`Publisher::dropped`] counts the messages dropped for either reason.
    pub fn publish(&self, message: &[u8]) -> u32 {
        self.publication.publish(message, |_| None)
    }

    /// Queues a message body for every subscriber, as [`Publisher::publish`] does. `own` receives
    /// each subscriber's name and can return a different body for that subscriber.
    pub fn publish_each(&self, message: &[u8], own: impl FnMut(&str) -> Option<Vec<u8>>) -> u32 {
        self.publication.publish(message, own)
    }

    /// Number of subscribers with an open connection.
    pub fn subscribers(&self) -> usize {
        self.publication.subscribers()
    }

    /// Number of messages dropped so far, summed over all subscribers, including disconnected ones.
    pub fn dropped(&self) -> u64 {
        self.publication.dropped()
    }

    /// Returns the number of waiting messages of every subscriber with an open connection.
    pub fn lags(&self) -> Vec<SubscriberLag> {
        self.publication.lags()
    }

    /// Full name of the topic after remapping.
    pub fn topic(&self) -> &str {
        &self.publication.name
    }
}

/// Handle of a topic that this node subscribes to; receives from all publishers of the topic.
/// Dropping the handle unsubscribes.
#[derive(Debug)]
pub struct Subscriber {
    pub(super) subscription: Arc<Subscription>,
    pub(super) _lease: Lease,
}

impl Subscriber {
    /// Returns the next message body. Waits while the queue is empty; returns `None` once the node
    /// has shut down and the queue is empty. Cancelling the wait loses no message.
    pub async fn recv(&mut self) -> Option<Vec<u8>> {
        self.subscription.inbox.messages.pop().await
    }

    /// Number of messages dropped because the queue was full when a newer one arrived.
    pub fn dropped(&self) -> u64 {
        self.subscription.inbox.dropped.load(Relaxed)
    }

    /// Number of publishers with an open connection.
    pub fn publishers(&self) -> usize {
        self.subscription.links().iter().filter(|link| link.is_connected()).count()
    }

    /// Publishers that cannot be reached, each as its URI, the reason and what to do.
    pub fn unreachable(&self) -> Vec<String> {
        self.subscription.unreachable()
    }

    /// Full name of the topic after remapping.
    pub fn topic(&self) -> &str {
        &self.subscription.inbox.topic
    }
}

/// Handle of a service that this node provides. Dropping the handle unregisters the service.
#[derive(Debug)]
#[must_use = "dropping the handle unregisters the service"]
pub struct Service {
    pub(super) _lease: Lease,
}
