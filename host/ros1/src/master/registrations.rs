//! Registrations at the master: publishers, subscribers, services and parameter subscribers. Like
//! rosmaster, lists them in the order of registration.

use std::collections::HashMap;

/// Kind of a registration. Its discriminant is the kind's index in [`Registrations::registers`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Publisher,
    Subscriber,
    Service,
    ParameterSubscriber,
}

/// A registered node and its XML-RPC URI.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Registrant {
    pub(super) node: String,
    pub(super) api: String,
}

/// All registrations of one kind, as pairs: the name of a topic, service or parameter, and the
/// nodes registered for it.
type Register = Vec<(String, Vec<Registrant>)>;

/// XML-RPC URI and registrations of one node. The entry is removed with the node's last
/// registration.
#[derive(Debug)]
struct NodeEntry {
    api: String,
    keys: Vec<(Kind, String)>,
}

#[derive(Debug, Default)]
pub(super) struct Registrations {
    nodes: HashMap<String, NodeEntry>,
    /// The register of each [`Kind`], indexed by the kind's discriminant.
    registers: [Register; 4],
    /// Maps a service name to its provider: (node name, service URI).
    service_uris: HashMap<String, (String, String)>,
    /// Whether any service has ever been registered. The error message for an unregistered service
    /// depends on this, as in rosmaster.
    had_service: bool,
}

impl Registrations {
    /// Registers `node` for the topic, service or parameter `key`. If a node of the same name but
    /// another XML-RPC URI was registered, removes the old node and returns its URI, so that the
    /// caller can ask that node to shut down.
    pub(super) fn register(
        &mut self,
        kind: Kind,
        key: &str,
        node: &str,
        api: &str,
    ) -> Option<String> {
        let displaced = match self.nodes.get(node) {
            Some(entry) if entry.api != api => Some(entry.api.clone()),
            _ => None,
        };
        if displaced.is_some() {
            self.nodes.remove(node);
            self.remove_node(node);
        }
        let entry = self
            .nodes
            .entry(node.to_owned())
            .or_insert_with(|| NodeEntry { api: api.to_owned(), keys: Vec::new() });
        if !entry.keys.iter().any(|(k, name)| *k == kind && name == key) {
            entry.keys.push((kind, key.to_owned()));
        }
        let registrant = Registrant { node: node.to_owned(), api: api.to_owned() };
        let register = &mut self.registers[kind as usize];
        match register.iter_mut().find(|(name, _)| name == key) {
            // A service has only one provider: the node that registered it last.
            Some((_, registrants)) if kind == Kind::Service => *registrants = vec![registrant],
            Some((_, registrants)) if registrants.contains(&registrant) => {}
            Some((_, registrants)) => registrants.push(registrant),
            None => register.push((key.to_owned(), vec![registrant])),
        }
        displaced
    }

    /// Registers the service `service` at `uri`. Returns the XML-RPC URI of a displaced node, as
    /// [`Registrations::register`] does.
    pub(super) fn register_service(
        &mut self,
        service: &str,
        node: &str,
        api: &str,
        uri: &str,
    ) -> Option<String> {
        let displaced = self.register(Kind::Service, service, node, api);
        self.had_service = true;
        self.service_uris.insert(service.to_owned(), (node.to_owned(), uri.to_owned()));
        displaced
    }

    /// Removes the registration for the topic, service or parameter `key` of the node named `node`
    /// with the XML-RPC URI `api`. Returns rosmaster's message, and whether that registration
    /// existed.
    pub(super) fn unregister(
        &mut self,
        kind: Kind,
        key: &str,
        node: &str,
        api: &str,
    ) -> (String, bool) {
        if !self.nodes.contains_key(node) {
            return (format!("[{node}] is not a registered node"), false);
        }
        let register = &mut self.registers[kind as usize];
        let mut found = false;
        if let Some((_, registrants)) = register.iter_mut().find(|(name, _)| name == key) {
            let before = registrants.len();
            registrants.retain(|registrant| registrant.node != node || registrant.api != api);
            found = registrants.len() < before;
        }
        register.retain(|(_, registrants)| !registrants.is_empty());
        self.remove_key(node, kind, key, found);
        let message = if found {
            format!("Unregistered [{node}] as provider of [{key}]")
        } else {
            format!("[{node}] is not a known provider of [{key}]")
        };
        (message, found)
    }

    /// Unregisters a service if `uri` is its current URI. Returns rosmaster's message and whether
    /// the registration existed.
    pub(super) fn unregister_service(
        &mut self,
        service: &str,
        node: &str,
        uri: &str,
    ) -> (String, bool) {
        if !self.nodes.contains_key(node) {
            return (format!("[{node}] is not a registered node"), false);
        }
        let current = self.service_uris.get(service);
        let found = current.is_some_and(|(owner, known)| owner == node && known == uri);
        if found {
            self.service_uris.remove(service);
            self.registers[Kind::Service as usize].retain(|(name, _)| name != service);
        }
        self.remove_key(node, Kind::Service, service, found);
        let message = if found {
            format!("Unregistered [{node}] as provider of [{service}]")
        } else if self.had_service {
            format!("[{uri}] is no longer the current service api handle for [{service}]")
        } else {
            format!("[{node}] is not a provider of [{service}]")
        };
        (message, found)
    }

    /// Returns the XML-RPC URI of a node; `None` if the node has no registration.
    pub(super) fn node_api(&self, node: &str) -> Option<&str> {
        self.nodes.get(node).map(|entry| entry.api.as_str())
    }

    /// Returns the URI of the service's current provider, `rosrpc://HOST:PORT`.
    pub(super) fn service_uri(&self, service: &str) -> Option<&str> {
        self.service_uris.get(service).map(|(_, uri)| uri.as_str())
    }

    /// Returns the XML-RPC URIs of all nodes registered for the topic, service or parameter `key`.
    pub(super) fn apis(&self, kind: Kind, key: &str) -> Vec<String> {
        let entries = self.entries(kind).iter();
        let found = entries.filter(|(name, _)| name == key);
        found
            .flat_map(|(_, registrants)| registrants)
            .map(|registrant| registrant.api.clone())
            .collect()
    }

    /// Returns all registrations of one kind in order of registration.
    pub(super) fn entries(&self, kind: Kind) -> &[(String, Vec<Registrant>)] {
        &self.registers[kind as usize]
    }

    fn remove_node(&mut self, node: &str) {
        for register in &mut self.registers {
            for (_, registrants) in &mut *register {
                registrants.retain(|registrant| registrant.node != node);
            }
            register.retain(|(_, registrants)| !registrants.is_empty());
        }
        self.service_uris.retain(|_, (owner, _)| owner != node);
    }

    fn remove_key(&mut self, node: &str, kind: Kind, key: &str, found: bool) {
        let Some(entry) = self.nodes.get_mut(node) else {
            return;
        };
        if found {
            entry.keys.retain(|(k, name)| *k != kind || name != key);
        }
        if entry.keys.is_empty() {
            self.nodes.remove(node);
        }
    }
}
