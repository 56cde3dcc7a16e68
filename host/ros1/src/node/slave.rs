//! The slave API of ROS: the XML-RPC methods that every node provides to the master and to other
//! nodes.

use std::sync::{
    Arc, Weak,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use super::registrar::Registrar;
use crate::{
    sync::lock,
    xmlrpc::{Fault, Value, caller_error, failure, success},
};

/// Handler of the XML-RPC calls that the node receives.
#[derive(Debug)]
pub(crate) struct Slave {
    pub(crate) registrar: Weak<Registrar>,
    /// Host name or address that subscribers connect to.
    pub(crate) host: String,
    /// Port of the TCPROS listener.
    pub(crate) port: u16,
}

impl Slave {
    /// Answers one XML-RPC call with the array (code, message, value), or with a fault if a node
    /// has no such method.
    pub(crate) fn answer(&self, method: &str, arguments: &[Value]) -> Result<Value, Fault> {
        let Some(node) = self.registrar.upgrade() else {
            return Ok(failure("the node is shutting down", 0));
        };
        Ok(match method {
            "getPid" => done(Value::process_id()),
            "getMasterUri" => done(node.master_uri.as_str()),
            "getBusStats" => done(bus_stats(&node)),
            "getBusInfo" => done(bus_info(&node)),
            "getSubscriptions" => {
                let graph = lock(&node.graph);
                let inboxes = graph.subscriptions.values().map(|topic| &topic.inbox);
                let pairs = inboxes.map(|inbox| [&*inbox.topic, inbox.message_type.name].into());
                done(pairs.collect::<Value>())
            }
            "getPublications" => {
                let graph = lock(&node.graph);
                let topics = graph.publications.values();
                let pairs = topics.map(|topic| [&*topic.name, topic.message_type.name].into());
                done(pairs.collect::<Value>())
            }
            "shutdown" => {
                let reason = arguments.get(1).and_then(Value::as_str).unwrap_or_default();
                tracing::warn!(node = node.node, reason, "asked to shut down");
                node.shutdown_requested.send_replace(true);
                done(0)
            }
            "publisherUpdate" => publisher_update(&node, arguments),
            // `paramUpdate` has no effect, because this node caches no parameters.
            "paramUpdate" => done(0),
            "requestTopic" => self.request_topic(&node, arguments),
            _ => {
                return Err(Fault::new(format!("method {method} is not known")));
            }
        })
    }

    fn request_topic(&self, node: &Registrar, arguments: &[Value]) -> Value {
        let [_, Value::String(topic), Value::Array(protocols)] = arguments else {
            return caller_error("requestTopic takes (caller, topic, protocols)", 0);
        };
        if !lock(&node.graph).publications.contains_key(topic) {
            return failure(format!("not a publisher of [{topic}]"), 0);
        }
        let tcpros = protocols.iter().any(|protocol| {
            let name = protocol.as_array().and_then(<[Value]>::first).and_then(Value::as_str);
            name == Some("TCPROS")
        });
        if !tcpros {
            let message = "no supported protocol implementations; this node speaks TCPROS";
            return failure(message, 0);
        }
        let port = Value::Int(i32::from(self.port));
        done(Value::Array(vec!["TCPROS".into(), self.host.as_str().into(), port]))
    }
}

fn publisher_update(node: &Registrar, arguments: &[Value]) -> Value {
    let [_, Value::String(topic), publishers @ Value::Array(_)] = arguments else {
        return caller_error("publisherUpdate takes (caller, topic, publishers)", 0);
    };
    let graph = lock(&node.graph);
    if let Some(subscription) = graph.subscriptions.get(topic) {
        subscription.set_publishers(&publishers.strings());
    }
    done(0)
}

/// Returns the result of `getBusInfo`: one array per connection, which holds its ID, peer,
/// direction, transport, topic, whether it is open, and a description.
fn bus_info(node: &Arc<Registrar>) -> Value {
    let graph = lock(&node.graph);
    let mut connections = Vec::new();
    let mut add = |id: u32, peer: &str, direction: &str, topic: &str, open: bool, text: String| {
        connections.push(Value::Array(vec![
            count(id.into()),
            peer.into(),
            direction.into(),
            "TCPROS".into(),
            topic.into(),
            open.into(),
            text.into(),
        ]));
    };
    for publication in graph.publications.values() {
        for link in publication.links() {
            let text = format!("TCPROS connection to [{}]", link.peer);
            add(link.id, &link.caller, "o", &publication.name, true, text);
        }
    }
    for subscription in graph.subscriptions.values() {
        for link in subscription.links() {
            let (uri, open) = (link.uri(), link.is_connected());
            let text = format!("TCPROS connection from [{uri}]");
            add(link.id, uri, "i", &subscription.inbox.topic, open, text);
        }
    }
    Value::Array(connections)
}

/// Returns the result of `getBusStats`: the byte and message counts of each connection, grouped
/// into publications, subscriptions and services.
fn bus_stats(node: &Arc<Registrar>) -> Value {
    let graph = lock(&node.graph);
    let publications = graph.publications.values().map(|publication| {
        let mut bytes = 0;
        let connections = publication.links().into_iter().map(|link| {
            bytes += link.bytes.load(Relaxed);
            let (sent, messages) = (loaded(&link.bytes), loaded(&link.messages));
            Value::Array(vec![count(u64::from(link.id)), sent, messages, true.into()])
        });
        let connections: Value = connections.collect();
        let name = publication.name.as_str().into();
        Value::Array(vec![name, count(bytes), connections])
    });
    let subscriptions = graph.subscriptions.values().map(|subscription| {
        let connections = subscription.links().into_iter().map(|link| {
            // -1 means unknown: TCPROS does not report the number of messages that a publisher has
            // dropped.
            let (received, dropped) = (loaded(&link.bytes), Value::Int(-1));
            let connected = link.is_connected().into();
            Value::Array(vec![count(u64::from(link.id)), received, dropped, connected])
        });
        let name = subscription.inbox.topic.as_str().into();
        Value::Array(vec![name, connections.collect()])
    });
    let services = Value::Array(vec![0.into(), 0.into(), 0.into()]);
    Value::Array(vec![publications.collect(), subscriptions.collect(), services])
}

fn loaded(counter: &AtomicU64) -> Value {
    count(counter.load(Relaxed))
}

/// Converts a count to XML-RPC's 32-bit integer; counts above 2^31 - 1 become 2^31 - 1.
fn count(number: u64) -> Value {
    Value::Int(i32::try_from(number).unwrap_or(i32::MAX))
}

fn done(value: impl Into<Value>) -> Value {
    success("", value)
}
