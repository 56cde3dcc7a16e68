//! The topics and services of a node, and the registration state of each at the master.

use std::{
    collections::{BTreeMap, HashSet},
    fmt,
    sync::Arc,
};

use crate::{publication::Publication, service::Provider, subscription::Subscription};

/// Identifies one registration: its kind and the full name of the topic or service.
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

/// All topics and services of the node, by full name. The graph is authoritative: the registrar
/// registers every entry that the master does not have.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    pub(crate) publications: BTreeMap<String, Arc<Publication>>,
    pub(crate) subscriptions: BTreeMap<String, Arc<Subscription>>,
    pub(crate) services: BTreeMap<String, Arc<Provider>>,
    /// Topics and services whose registration the master has accepted.
    pub(crate) registered: HashSet<Key>,
    /// Topics and services that still have to be unregistered after their handle was dropped.
    pub(crate) leaving: HashSet<Key>,
    /// Topics and services that the master refused at the last attempt. Used to log each refusal
    /// only once.
    pub(crate) refused: HashSet<Key>,
    /// True after shutdown has started: nothing can be added any more.
    pub(crate) closed: bool,
}

impl Graph {
    /// Returns the keys of all topics and services, which should all be registered at the master.
    pub(crate) fn keys(&self) -> Vec<Key> {
        let publishers = self.publications.keys().cloned().map(Key::Publisher);
        let subscribers = self.subscriptions.keys().cloned().map(Key::Subscriber);
        let services = self.services.keys().cloned().map(Key::Service);
        publishers.chain(subscribers).chain(services).collect()
    }

    pub(crate) fn contains(&self, key: &Key) -> bool {
        match key {
            Key::Publisher(name) => self.publications.contains_key(name),
            Key::Subscriber(name) => self.subscriptions.contains_key(name),
            Key::Service(name) => self.services.contains_key(name),
        }
    }

    /// Removes a topic or service from the graph and closes its connections.
    pub(crate) fn remove(&mut self, key: &Key) {
        self.registered.remove(key);
        self.refused.remove(key);
        match key {
            Key::Publisher(name) => {
                if let Some(publication) = self.publications.remove(name) {
                    publication.close();
                }
            }
            Key::Subscriber(name) => {
                if let Some(subscription) = self.subscriptions.remove(name) {
                    subscription.close();
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
