//! The master's list of publishers and services.

use crate::xmlrpc::Value;

/// Nodes that publish topics or provide services, as the master knows them at one moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SystemState {
    publishers: Vec<(String, Vec<String>)>,
    services: Vec<(String, Vec<String>)>,
}

impl SystemState {
    /// Reads the answer to `getSystemState`: publishers, subscribers and services, each as pairs of
    /// a name and a list of nodes. Returns `None` if the value has another shape.
    pub fn from_value(value: &Value) -> Option<Self> {
        let [publishers, _subscribers, services] = value.as_array()? else {
            return None;
        };
        Some(Self {
            publishers: entries(publishers)?,
            services: entries(services)?,
        })
    }

    /// Returns the full names of the nodes that publish `topic`, in the order of their registration.
    /// `topic` is a full name.
    pub fn publishers(&self, topic: &str) -> &[String] {
        nodes(&self.publishers, topic)
    }

    /// Returns whether any node provides `service`, which is a full name.
    pub(crate) fn has_service(&self, service: &str) -> bool {
        !nodes(&self.services, service).is_empty()
    }
}

fn entries(list: &Value) -> Option<Vec<(String, Vec<String>)>> {
    let pairs = list.as_array()?.iter().map(|pair| match pair.as_array()? {
        [Value::String(name), nodes] => Some((name.clone(), nodes.strings())),
        _ => None,
    });
    pairs.collect()
}

fn nodes<'a>(entries: &'a [(String, Vec<String>)], name: &str) -> &'a [String] {
    let entry = entries.iter().find(|(key, _)| key == name);
    entry.map_or(&[], |(_, nodes)| nodes)
}
