//! Keeps the master's registrations equal to the node's graph.

use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::Duration,
};

use tokio::{
    sync::{mpsc, watch},
    time::{Instant, sleep_until, timeout},
};

use super::graph::{Graph, Key};
use crate::{
    address::LookupError,
    sync::lock,
    xmlrpc::{CallError, CallFailure, Value, call_ros},
};

/// Period of the registration check while the master answers.
const ONLINE_PERIOD: Duration = Duration::from_secs(1);
/// Period of the registration check while the master does not answer.
const OFFLINE_PERIOD: Duration = Duration::from_millis(500);
/// Longest time that adding a topic or service waits for a master that accepts the connection but
/// does not answer.
const REGISTER_TIMEOUT: Duration = Duration::from_secs(2);
/// Total time limit for all unregistrations at shutdown.
const UNREGISTER_TIMEOUT: Duration = Duration::from_secs(2);

/// Registration state of a node, and the calls that bring the master's registrations into line with
/// the node's graph.
#[derive(Debug)]
pub(crate) struct Registrar {
    /// Full name of the node, `/namespace/name`.
    pub(crate) node: String,
    pub(crate) master_uri: String,
    /// URI of the node's XML-RPC server.
    pub(crate) api_uri: String,
    /// URI of the node's TCPROS listener, `rosrpc://HOST:PORT`.
    pub(crate) service_uri: String,
    pub(crate) graph: Mutex<Graph>,
    pub(crate) master: watch::Sender<MasterStatus>,
    pub(crate) shutdown_requested: watch::Sender<bool>,
    released: mpsc::UnboundedSender<Key>,
    /// True if the last call to the master timed out. While it is true, only the background
    /// registration task waits for the master.
    unresponsive: AtomicBool,
    /// Serialises calls to the master, so that they arrive in the order in which the graph changed.
    master_calls: tokio::sync::Mutex<()>,
}

impl Registrar {
    /// Creates a registrar, and the receiver to pass to [`Registrar::run`]. The receiver gets the
    /// key of each topic or service whose handle is dropped.
    pub(crate) fn new(
        node: String,
        master_uri: String,
        api_uri: String,
        service_uri: String,
    ) -> (Self, mpsc::UnboundedReceiver<Key>) {
        let (released, released_keys) = mpsc::unbounded_channel();
        let registrar = Self {
            node,
            master_uri,
            api_uri,
            service_uri,
            graph: Mutex::default(),
            master: watch::Sender::new(MasterStatus::Unknown),
            shutdown_requested: watch::Sender::new(false),
            released,
            unresponsive: AtomicBool::new(false),
            master_calls: tokio::sync::Mutex::default(),
        };
        (registrar, released_keys)
    }

    /// Body of the registration task: checks the master periodically, registers all topics and
    /// services that the master does not have, and unregisters those whose handle was dropped. Runs
    /// until aborted.
    pub(crate) async fn run(self: Arc<Self>, mut released_keys: mpsc::UnboundedReceiver<Key>) {
        let mut next = Instant::now();
        loop {
            tokio::select! {
                Some(key) = released_keys.recv() => self.unregister_released(&key).await,
                () = sleep_until(next) => {
                    let started = Instant::now();
                    // `sync` has already logged refusals; the next check offers the refused keys
                    // again.
                    let _ = self.sync().await;
                    let online = *self.master.borrow() == MasterStatus::Online;
                    next = started + if online { ONLINE_PERIOD } else { OFFLINE_PERIOD };
                }
            }
        }
    }

    /// Asks the master whether it knows this node, and registers every topic and service that is
    /// not registered yet. Returns the keys that the master refused, each with its error. An
    /// unreachable master is not a refusal.
    pub(crate) async fn sync(&self) -> Vec<(Key, CallError)> {
        let _calls = self.master_calls.lock().await;
        // If another node has taken this node's name, do not register: registering would displace
        // that node.
        if *self.shutdown_requested.borrow() {
            return Vec::new();
        }
        match self.call("lookupNode", &[self.node.as_str().into()]).await {
            Ok(uri) if uri.as_str() == Some(&self.api_uri) => {}
            Ok(uri) => {
                let mut graph = lock(&self.graph);
                if !graph.registered.is_empty() {
                    graph.registered.clear();
                    let uri = uri.as_str().unwrap_or("an unknown address");
                    tracing::warn!(node = self.node, uri, "another node has taken this name");
                    self.shutdown_requested.send_replace(true);
                    return Vec::new();
                }
                // The master has the URI of an earlier node of this name. Registering again
                // displaces that node.
            }
            Err(CallError::Refused { .. }) => lock(&self.graph).registered.clear(),
            Err(error) => {
                self.set_offline(&error);
                return Vec::new();
            }
        }
        self.find_lost().await;
        let refused = self.register_missing().await;
        refused.unwrap_or_else(|error| {
            self.set_offline(&error);
            Vec::new()
        })
    }

    /// Runs [`Registrar::sync`] within [`REGISTER_TIMEOUT`] after a key was added. If the master is
    /// too slow, returns no refusals; the registration task registers the key later.
    pub(crate) async fn sync_within_timeout(&self) -> Vec<(Key, CallError)> {
        if self.unresponsive.load(Relaxed) {
            return Vec::new();
        }
        let refused = timeout(REGISTER_TIMEOUT, self.sync()).await;
        refused.unwrap_or_else(|_| {
            self.unresponsive.store(true, Relaxed);
            Vec::new()
        })
    }

    /// Asks the master which nodes publish topics, subscribe to topics and provide services.
    pub(crate) async fn system_state(&self) -> Result<SystemState, CallError> {
        let method = "getSystemState";
        let state = self.call(method, &[]).await?;
        SystemState::from_value(&state)
            .ok_or_else(|| CallFailure::Shape.of(&self.master_uri, method))
    }

    /// Marks as unregistered every key that the master does not list. Registrations get lost in two
    /// ways. A master that restarts during the calls of [`Registrar::sync`] knows only what was
    /// registered after its restart. If another node takes over a service and leaves, the master
    /// does not return the service to this node.
    async fn find_lost(&self) {
        if lock(&self.graph).registered.is_empty() {
            return;
        }
        // Ignore the error: the calls that follow reach the same master and report it.
        let Ok(state) = self.system_state().await else {
            return;
        };
        lock(&self.graph).registered.retain(|key| match key {
            Key::Publisher(name) => state.publishers(name).contains(&self.node),
            Key::Subscriber(name) => nodes(&state.subscribers, name).contains(&self.node),
            Key::Service(name) => state.has_service(name),
        });
    }

    async fn register_missing(&self) -> Result<Vec<(Key, CallError)>, CallError> {
        let missing: Vec<Key> = {
            let graph = lock(&self.graph);
            graph.keys().into_iter().filter(|key| !graph.registered.contains(key)).collect()
        };
        let mut refused = Vec::new();
        for key in missing {
            match self.register(&key).await {
                Ok(()) => {
                    lock(&self.graph).refused.remove(&key);
                }
                Err(error @ CallError::Refused { .. }) => {
                    if lock(&self.graph).refused.insert(key.clone()) {
                        tracing::error!(
                            node = self.node,
                            "the master refused the {key}: {error}; it is offered again every \
                             second"
                        );
                    }
                    refused.push((key, error));
                }
                Err(error) => return Err(error),
            }
        }
        if self.master.send_replace(MasterStatus::Online) != MasterStatus::Online {
            tracing::info!(master = self.master_uri, "the master answers; all is registered");
        }
        Ok(refused)
    }

    /// Registers one key and marks it as registered, unless the graph changed during the call. A
    /// key released during the call is queued for unregistration. A key released and added again
    /// during the call still has to be registered.
    async fn register(&self, key: &Key) -> Result<(), CallError> {
        let api = Value::from(self.api_uri.as_str());
        match key {
            Key::Publisher(name) => {
                let Some(topic) = lock(&self.graph).publications.get(name).cloned() else {
                    return Ok(());
                };
                let arguments = [name.as_str().into(), topic.message_type.name.into(), api];
                self.call("registerPublisher", &arguments).await?;
                let mut graph = lock(&self.graph);
                if is_same(graph.publications.get(name), &topic) {
                    graph.registered.insert(key.clone());
                }
            }
            Key::Subscriber(name) => {
                let Some(topic) = lock(&self.graph).subscriptions.get(name).cloned() else {
                    return Ok(());
                };
                let type_name = topic.inbox.message_type.name;
                let arguments = [name.as_str().into(), type_name.into(), api];
                let publishers = self.call("registerSubscriber", &arguments).await?;
                let mut graph = lock(&self.graph);
                if is_same(graph.subscriptions.get(name), &topic) {
                    topic.add_publishers(&publishers.strings());
                    graph.registered.insert(key.clone());
                }
            }
            Key::Service(name) => {
                let Some(provider) = lock(&self.graph).services.get(name).cloned() else {
                    return Ok(());
                };
                let arguments = [name.as_str().into(), self.service_uri.as_str().into(), api];
                self.call("registerService", &arguments).await?;
                let mut graph = lock(&self.graph);
                if is_same(graph.services.get(name), &provider) {
                    graph.registered.insert(key.clone());
                }
            }
        }
        Ok(())
    }

    /// Removes a key from the graph and queues it for unregistration by the registration task.
    pub(crate) fn release(&self, key: &Key) {
        let mut graph = lock(&self.graph);
        if !graph.closed {
            graph.remove(key);
            graph.leaving.insert(key.clone());
            // Sending fails only after the node has been dropped.
            let _ = self.released.send(key.clone());
        }
    }

    async fn unregister_released(&self, key: &Key) {
        let _calls = self.master_calls.lock().await;
        // A key that was added again after its release stays registered.
        if !lock(&self.graph).contains(key)
            && let Err(error) = self.unregister(key).await
        {
            tracing::debug!(node = self.node, "{key} could not be unregistered: {error}");
        }
        lock(&self.graph).leaving.remove(key);
    }

    async fn unregister(&self, key: &Key) -> Result<Value, CallError> {
        let (method, name, uri) = match key {
            Key::Publisher(name) => ("unregisterPublisher", name, &self.api_uri),
            Key::Subscriber(name) => ("unregisterSubscriber", name, &self.api_uri),
            Key::Service(name) => ("unregisterService", name, &self.service_uri),
        };
        self.call(method, &[name.as_str().into(), uri.as_str().into()]).await
    }

    /// Closes the graph and unregisters all its keys within [`UNREGISTER_TIMEOUT`]. Includes keys
    /// that were released earlier but not yet unregistered by the registration task.
    pub(crate) async fn unregister_all(&self) {
        let keys = {
            let mut graph = lock(&self.graph);
            graph.closed = true;
            let mut keys = graph.keys();
            for key in &keys {
                graph.remove(key);
            }
            keys.extend(std::mem::take(&mut graph.leaving));
            keys
        };
        let unregister_each = async {
            let _calls = self.master_calls.lock().await;
            for key in keys {
                if let Err(error) = self.unregister(&key).await {
                    tracing::debug!(node = self.node, "{key} could not be unregistered: {error}");
                    if !matches!(error, CallError::Refused { .. }) {
                        return;
                    }
                }
            }
        };
        if timeout(UNREGISTER_TIMEOUT, unregister_each).await.is_err() {
            tracing::warn!(
                master = self.master_uri,
                "the master answered too slowly to unregister everything"
            );
        }
    }

    async fn call(&self, method: &str, arguments: &[Value]) -> Result<Value, CallError> {
        let mut all = vec![Value::from(self.node.as_str())];
        all.extend_from_slice(arguments);
        let outcome = call_ros(&self.master_uri, method, &all).await;
        let timed_out =
            matches!(outcome, Err(CallError::Failed { failure: CallFailure::Timeout, .. }));
        self.unresponsive.store(timed_out, Relaxed);
        outcome
    }

    fn set_offline(&self, error: &CallError) {
        let status = match error {
            CallError::Failed { failure: CallFailure::Lookup(error), .. } => {
                MasterStatus::Unresolved(error.clone())
            }
            error => MasterStatus::Silent(error.to_string()),
        };
        let before = self.master.borrow().clone();
        if before == MasterStatus::Online {
            tracing::warn!(
                master = self.master_uri,
                "the master does not answer any more: {error}"
            );
        }
        if before != status {
            self.master.send_replace(status);
        }
    }
}

/// What a node knows about its master.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MasterStatus {
    /// The node has not called the master yet, or has shut down.
    Unknown,
    /// The master answers, and the node has tried to register every topic and service. The master
    /// can have refused some of them.
    Online,
    /// The name of the master's host has no address.
    Unresolved(LookupError),
    /// The master does not answer. Holds the reason.
    Silent(String),
}

fn is_same<T>(now: Option<&Arc<T>>, before: &Arc<T>) -> bool {
    now.is_some_and(|now| Arc::ptr_eq(now, before))
}

/// Nodes that publish topics, subscribe to topics or provide services, as the master knows them at
/// one moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SystemState {
    publishers: Vec<(String, Vec<String>)>,
    subscribers: Vec<(String, Vec<String>)>,
    services: Vec<(String, Vec<String>)>,
}

impl SystemState {
    /// Converts the response to `getSystemState`: publishers, subscribers and services, each as
    /// pairs of a name and a list of nodes. Returns `None` if the value has another shape.
    pub fn from_value(value: &Value) -> Option<Self> {
        let [publishers, subscribers, services] = value.as_array()? else {
            return None;
        };
        Some(Self {
            publishers: entries(publishers)?,
            subscribers: entries(subscribers)?,
            services: entries(services)?,
        })
    }

    /// Returns the full names of the nodes that publish `topic`, in the order of their
    /// registration. `topic` is a full name.
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
