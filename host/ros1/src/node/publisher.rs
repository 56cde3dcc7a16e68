//! The handle of a published topic.

use std::sync::Arc;

use super::lease::Lease;
use crate::topic::publication::{Publication, SubscriberLag};

/// Handle of a topic that this node publishes. All clones publish on the same topic; dropping the
/// last clone unregisters the topic.
#[derive(Debug, Clone)]
pub struct Publisher {
    publication: Arc<Publication>,
    _lease: Arc<Lease>,
}

impl Publisher {
    pub(crate) fn new(publication: Arc<Publication>, lease: Lease) -> Self {
        Self {
            publication,
            _lease: Arc::new(lease),
        }
    }

    /// Queues one message body for every subscriber, without waiting. Returns the number of
    /// subscribers, or 0 if the body was too long.
    ///
    /// All subscriber queues share one copy of the body; without subscribers no memory is
    /// allocated. A full queue drops its oldest message. A body longer than
    /// [`MAX_MESSAGE`](crate::tcpros::MAX_MESSAGE) is dropped for all subscribers.
    /// [`Publisher::dropped`] counts the messages dropped for either reason.
    pub fn publish(&self, message: &[u8]) -> u32 {
        self.publication.publish(message)
    }

    /// Number of subscribers with an open connection.
    pub fn subscribers(&self) -> usize {
        self.publication.subscribers()
    }

    /// Number of messages dropped so far, summed over all subscribers, including disconnected ones.
    pub fn dropped(&self) -> u64 {
        self.publication.dropped()
    }

    /// Returns the lag of every subscriber with an open connection.
    pub fn lags(&self) -> Vec<SubscriberLag> {
        self.publication.lags()
    }

    /// Full name of the topic after remapping.
    pub fn topic(&self) -> &str {
        &self.publication.name
    }
}
