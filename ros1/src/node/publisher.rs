//! The handle of a published topic.

use std::sync::Arc;

use super::lease::Lease;
use crate::topic::publication::Publication;

/// A topic that this node publishes. Clones share the topic; it is unregistered when the last
/// clone is dropped.
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

    /// Queues one message body for every subscriber and returns the number of subscribers. Never
    /// waits.
    ///
    /// All queues share one allocation; without subscribers there is none. A full queue drops its
    /// oldest message, and a body longer than [`MAX_MESSAGE`](crate::tcpros::MAX_MESSAGE) is
    /// dropped as a whole. [`Publisher::dropped`] counts both.
    pub fn publish(&self, message: &[u8]) -> u32 {
        self.publication.publish(message)
    }

    /// Number of subscribers connected now.
    pub fn subscribers(&self) -> usize {
        self.publication.subscribers()
    }

    /// Messages dropped so far, summed over all subscribers, including disconnected ones.
    pub fn dropped(&self) -> u64 {
        self.publication.dropped()
    }

    /// Full name of the topic after remapping.
    pub fn topic(&self) -> &str {
        &self.publication.name
    }
}
