//! Topics coming in.

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU32, AtomicU64, Ordering::Relaxed},
    },
};

use tokio::task::AbortHandle;

use crate::{
    drop_oldest::{DropOldest, Put},
    graph::Lease,
    inlet::Inlet,
    lock::lock,
    message_type::MessageType,
};

/// A topic that this node subscribes to, from all its publishers; it is given up when this is
/// dropped.
#[derive(Debug)]
pub struct Subscriber {
    topic: Arc<IncomingTopic>,
    _lease: Lease,
}

impl Subscriber {
    pub(crate) fn new(topic: Arc<IncomingTopic>, lease: Lease) -> Self {
        Self {
            topic,
            _lease: lease,
        }
    }

    /// The next message body; waits for one. `None` once the node has shut down and everything
    /// that had come is taken. Cancelling loses nothing.
    pub async fn recv(&mut self) -> Option<Vec<u8>> {
        self.topic.messages.take().await
    }

    /// Messages dropped because nobody took them in time: the oldest goes.
    pub fn dropped(&self) -> u64 {
        self.topic.dropped.load(Relaxed)
    }

    /// Publishers connected now.
    pub fn publishers(&self) -> usize {
        self.topic
            .inlets()
            .iter()
            .filter(|inlet| inlet.connected())
            .count()
    }

    /// The topic's full name, remapped.
    pub fn topic(&self) -> &str {
        &self.topic.name
    }
}

/// One topic of the node's, with a connection to each publisher.
#[derive(Debug)]
pub(crate) struct IncomingTopic {
    pub(crate) name: String,
    pub(crate) message_type: &'static MessageType,
    node: String,
    messages: DropOldest<Vec<u8>>,
    dropped: AtomicU64,
    connections: Mutex<HashMap<String, Connection>>,
    next_id: AtomicU32,
}

#[derive(Debug)]
struct Connection {
    inlet: Arc<Inlet>,
    task: AbortHandle,
}

impl IncomingTopic {
    pub(crate) fn new(
        name: String,
        message_type: &'static MessageType,
        node: &str,
        queue: usize,
    ) -> Self {
        Self {
            name,
            message_type,
            node: node.to_owned(),
            messages: DropOldest::new(queue),
            dropped: AtomicU64::new(0),
            connections: Mutex::default(),
            next_id: AtomicU32::new(0),
        }
    }

    /// The node that subscribes.
    pub(crate) fn node(&self) -> &str {
        &self.node
    }

    /// A message came; false when nobody wants any more.
    pub(crate) fn deliver(&self, message: Vec<u8>) -> bool {
        match self.messages.put(message) {
            Put::Kept => true,
            Put::DroppedOldest => {
                self.dropped.fetch_add(1, Relaxed);
                true
            }
            Put::Closed => false,
        }
    }

    /// The connections of now.
    pub(crate) fn inlets(&self) -> Vec<Arc<Inlet>> {
        lock(&self.connections)
            .values()
            .map(|connection| Arc::clone(&connection.inlet))
            .collect()
    }

    /// Connects to those of `publishers` that are not connected yet. Prunes none: after its
    /// restart a master knows only the publishers that have registered again.
    pub(crate) fn add_publishers(self: &Arc<Self>, publishers: &[String]) {
        let mut connections = lock(&self.connections);
        for uri in publishers {
            if let Some(connection) = connections.get(uri) {
                connection.inlet.want();
                continue;
            }
            let id = self.next_id.fetch_add(1, Relaxed);
            let inlet = Arc::new(Inlet::new(id, uri.clone()));
            let run = Arc::clone(&inlet).run(Arc::clone(self));
            let task = tokio::spawn(run).abort_handle();
            connections.insert(uri.clone(), Connection { inlet, task });
        }
    }

    /// The master says that `publishers` are all. A publisher that is not among them is not
    /// called again; a living connection to it stays until the publisher ends it.
    pub(crate) fn set_publishers(self: &Arc<Self>, publishers: &[String]) {
        lock(&self.connections).retain(|uri, connection| {
            if publishers.contains(uri) || connection.inlet.unwant() {
                return true;
            }
            connection.task.abort();
            false
        });
        self.add_publishers(publishers);
    }

    /// A connection ended: true when its publisher is not wanted any more and was forgotten.
    pub(crate) fn forget_unwanted(&self, inlet: &Inlet) -> bool {
        let mut connections = lock(&self.connections);
        let wanted = inlet.wanted();
        if !wanted {
            connections.remove(inlet.uri());
        }
        !wanted
    }

    /// Ends every connection; what has come can still be taken.
    pub(crate) fn close(&self) {
        for (_, connection) in lock(&self.connections).drain() {
            connection.task.abort();
        }
        self.messages.close();
    }
}
