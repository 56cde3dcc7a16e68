//! What the node answers to the master and to other nodes: ROS's slave API.

use std::sync::{
    Arc, Weak,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use crate::{
    lock::lock,
    registrar::{Registrar, uris},
    xmlrpc::{Fault, Value},
};

/// The node's side of XML-RPC.
#[derive(Debug)]
pub(crate) struct Slave {
    pub(crate) registrar: Weak<Registrar>,
    /// The host name or address that subscribers are sent to.
    pub(crate) host: String,
    /// The port of the TCPROS listener.
    pub(crate) port: u16,
}

impl Slave {
    /// Answers one call with the ROS triple (code, message, value).
    pub(crate) fn answer(&self, method: &str, arguments: &[Value]) -> Result<Value, Fault> {
        let Some(node) = self.registrar.upgrade() else {
            return Ok(failure("the node is shutting down"));
        };
        Ok(match method {
            "getPid" => success(pid()),
            "getMasterUri" => success(node.master_uri.as_str()),
            "getBusStats" => success(bus_stats(&node)),
            "getBusInfo" => success(bus_info(&node)),
            "getSubscriptions" => {
                let graph = lock(&node.graph);
                let topics = graph.subscribers.values();
                success(
                    topics
                        .map(|t| pair(&t.name, t.message_type.name))
                        .collect::<Value>(),
                )
            }
            "getPublications" => {
                let graph = lock(&node.graph);
                let topics = graph.publishers.values();
                success(
                    topics
                        .map(|t| pair(&t.name, t.message_type.name))
                        .collect::<Value>(),
                )
            }
            "shutdown" => {
                let reason = arguments.get(1).and_then(Value::as_str).unwrap_or_default();
                tracing::warn!(node = node.node, reason, "asked to shut down");
                node.shutdown_requested.send_replace(true);
                success(0)
            }
            "publisherUpdate" => publisher_update(&node, arguments),
            // This node keeps no copies of parameters.
            "paramUpdate" => success(0),
            "requestTopic" => self.request_topic(&node, arguments),
            _ => {
                return Err(Fault {
                    code: 1,
                    message: format!("method {method:?} is not known"),
                });
            }
        })
    }

    fn request_topic(&self, node: &Registrar, arguments: &[Value]) -> Value {
        let [_, Value::String(topic), Value::Array(protocols)] = arguments else {
            return error("requestTopic takes (caller, topic, protocols)");
        };
        if !lock(&node.graph).publishers.contains_key(topic) {
            return failure(&format!("not a publisher of [{topic}]"));
        }
        let tcpros = protocols.iter().any(|protocol| {
            let name = protocol
                .as_array()
                .and_then(<[Value]>::first)
                .and_then(Value::as_str);
            name == Some("TCPROS")
        });
        if !tcpros {
            return failure("no supported protocol implementations; this node speaks TCPROS");
        }
        let port = Value::Int(i32::from(self.port));
        success(Value::Array(vec![
            "TCPROS".into(),
            self.host.as_str().into(),
            port,
        ]))
    }
}

fn publisher_update(node: &Registrar, arguments: &[Value]) -> Value {
    let [_, Value::String(topic), publishers @ Value::Array(_)] = arguments else {
        return error("publisherUpdate takes (caller, topic, publishers)");
    };
    let graph = lock(&node.graph);
    if let Some(topic) = graph.subscribers.get(topic) {
        topic.set_publishers(&uris(publishers));
    }
    success(0)
}

/// For each connection: id, the other side, direction, transport, topic, connected, words.
fn bus_info(node: &Arc<Registrar>) -> Value {
    let graph = lock(&node.graph);
    let mut connections = Vec::new();
    for topic in graph.publishers.values() {
        for outlet in topic.outlets() {
            connections.push(Value::Array(vec![
                count(u64::from(outlet.id)),
                outlet.caller.as_str().into(),
                "o".into(),
                "TCPROS".into(),
                topic.name.as_str().into(),
                true.into(),
                format!("TCPROS connection to [{}]", outlet.peer).into(),
            ]));
        }
    }
    for topic in graph.subscribers.values() {
        for inlet in topic.inlets() {
            connections.push(Value::Array(vec![
                count(u64::from(inlet.id)),
                inlet.uri().into(),
                "i".into(),
                "TCPROS".into(),
                topic.name.as_str().into(),
                inlet.connected().into(),
                format!("TCPROS connection from [{}]", inlet.uri()).into(),
            ]));
        }
    }
    Value::Array(connections)
}

/// Publications, subscriptions and services, each with its connections' bytes and messages.
fn bus_stats(node: &Arc<Registrar>) -> Value {
    let graph = lock(&node.graph);
    let publications = graph.publishers.values().map(|topic| {
        let mut bytes = 0;
        let connections = topic.outlets().into_iter().map(|outlet| {
            bytes += outlet.bytes.load(Relaxed);
            let (sent, messages) = (loaded(&outlet.bytes), loaded(&outlet.messages));
            Value::Array(vec![
                count(u64::from(outlet.id)),
                sent,
                messages,
                true.into(),
            ])
        });
        let connections: Value = connections.collect();
        Value::Array(vec![topic.name.as_str().into(), count(bytes), connections])
    });
    let subscriptions = graph.subscribers.values().map(|topic| {
        let connections = topic.inlets().into_iter().map(|inlet| {
            // -1: TCP does not tell what a publisher has dropped.
            let (received, dropped) = (loaded(&inlet.bytes), Value::Int(-1));
            let connected = inlet.connected().into();
            Value::Array(vec![
                count(u64::from(inlet.id)),
                received,
                dropped,
                connected,
            ])
        });
        Value::Array(vec![topic.name.as_str().into(), connections.collect()])
    });
    let services = Value::Array(vec![0.into(), 0.into(), 0.into()]);
    Value::Array(vec![
        publications.collect(),
        subscriptions.collect(),
        services,
    ])
}

fn loaded(counter: &AtomicU64) -> Value {
    count(counter.load(Relaxed))
}

/// XML-RPC has 32 bits: a larger count stays at the end of its range.
fn count(number: u64) -> Value {
    Value::Int(i32::try_from(number).unwrap_or(i32::MAX))
}

/// The process id as XML-RPC carries it.
pub(crate) fn pid() -> i32 {
    i32::try_from(std::process::id()).unwrap_or(i32::MAX)
}

fn pair(topic: &str, type_name: &str) -> Value {
    Value::from([topic, type_name])
}

fn success(value: impl Into<Value>) -> Value {
    Value::Array(vec![1.into(), "".into(), value.into()])
}

fn failure(words: &str) -> Value {
    Value::Array(vec![0.into(), words.into(), 0.into()])
}

fn error(words: &str) -> Value {
    Value::Array(vec![(-1).into(), words.into(), 0.into()])
}
