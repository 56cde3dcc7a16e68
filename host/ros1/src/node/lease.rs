//! Ties the registration of a topic or service to the lifetime of its handle.

use std::{
    fmt,
    sync::{Arc, Weak},
};

use super::{graph::Key, registrar::Registrar};

/// Keeps one topic or service in the node's graph. Dropping the lease removes the topic or service
/// from the graph and unregisters it.
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
