//! What the node offers and wants: the truth from which every registration is made again.

use std::{
    collections::{BTreeMap, HashSet},
    fmt,
    sync::{Arc, Weak},
};

use crate::{
    publisher::OutgoingTopic, registrar::Registrar, service::Provider, subscriber::IncomingTopic,
};

/// One thing to register, by its full name.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Key {
    Publisher(String),
    Subscriber(String),
    Service(String),
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Publisher(name) => write!(f, "publisher of {name}"),
            Self::Subscriber(name) => write!(f, "subscriber of {name}"),
            Self::Service(name) => write!(f, "service {name}"),
        }
    }
}

/// Everything the node has, and how much of it the master knows.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    pub(crate) publishers: BTreeMap<String, Arc<OutgoingTopic>>,
    pub(crate) subscribers: BTreeMap<String, Arc<IncomingTopic>>,
    pub(crate) services: BTreeMap<String, Arc<Provider>>,
    pub(crate) registered: HashSet<Key>,
    /// What was dropped and the master has not been told of.
    pub(crate) leaving: HashSet<Key>,
    /// What the master refused last time, so that the log says it once.
    pub(crate) refused: HashSet<Key>,
    /// The node has shut down: nothing comes in any more.
    pub(crate) closed: bool,
}

impl Graph {
    /// Everything that ought to be registered.
    pub(crate) fn keys(&self) -> Vec<Key> {
        let publishers = self.publishers.keys().cloned().map(Key::Publisher);
        let subscribers = self.subscribers.keys().cloned().map(Key::Subscriber);
        let services = self.services.keys().cloned().map(Key::Service);
        publishers.chain(subscribers).chain(services).collect()
    }

    pub(crate) fn contains(&self, key: &Key) -> bool {
        match key {
            Key::Publisher(name) => self.publishers.contains_key(name),
            Key::Subscriber(name) => self.subscribers.contains_key(name),
            Key::Service(name) => self.services.contains_key(name),
        }
    }

    /// Takes one thing out and ends its connections.
    pub(crate) fn remove(&mut self, key: &Key) {
        self.registered.remove(key);
        self.refused.remove(key);
        match key {
            Key::Publisher(name) => {
                if let Some(topic) = self.publishers.remove(name) {
                    topic.close();
                }
            }
            Key::Subscriber(name) => {
                if let Some(topic) = self.subscribers.remove(name) {
                    topic.close();
                }
            }
            Key::Service(name) => {
                if let Some(provider) = self.services.remove(name) {
                    provider.close();
                }
            }
        }
    }
}

/// Holds one thing in the graph; dropping it takes the thing out and unregisters it.
pub(crate) struct Lease {
    key: Key,
    registrar: Weak<Registrar>,
}

impl Lease {
    pub(crate) fn new(key: Key, registrar: &Arc<Registrar>) -> Self {
        Self {
            key,
            registrar: Arc::downgrade(registrar),
        }
    }

    /// What it holds.
    pub(crate) fn key(&self) -> &Key {
        &self.key
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        if let Some(registrar) = self.registrar.upgrade() {
            registrar.release(&self.key);
        }
    }
}

impl fmt::Debug for Lease {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Lease").field(&self.key).finish()
    }
}
