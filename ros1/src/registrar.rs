//! Keeps the master's knowledge of this node equal to the node's graph.

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

use crate::{
    graph::{Graph, Key},
    lock::lock,
    xmlrpc::{CallError, Value, call_ros},
};

/// How often a master that answers is asked whether it still knows us.
const ONLINE_PERIOD: Duration = Duration::from_secs(1);
/// How often one that does not answer is tried.
const OFFLINE_PERIOD: Duration = Duration::from_millis(500);
/// Whoever offers something waits this long for a master that takes the call and does not answer.
const OFFER_LIMIT: Duration = Duration::from_secs(2);
/// Unregistering at shutdown may take this long in all: a master that is gone must not hold us.
const FAREWELL_LIMIT: Duration = Duration::from_secs(2);

/// The node as the master sees it.
#[derive(Debug)]
pub(crate) struct Registrar {
    pub(crate) node: String,
    pub(crate) master_uri: String,
    /// Our XML-RPC server.
    pub(crate) api_uri: String,
    /// Our TCPROS listener, `rosrpc://HOST:PORT`.
    pub(crate) service_uri: String,
    pub(crate) graph: Mutex<Graph>,
    pub(crate) online: watch::Sender<bool>,
    pub(crate) shutdown_requested: watch::Sender<bool>,
    released: mpsc::UnboundedSender<Key>,
    /// The last call had no answer in time: nobody but the keeper waits for the next one.
    mute: AtomicBool,
    /// One conversation with the master at a time, so that its order is the graph's.
    conversation: tokio::sync::Mutex<()>,
}

impl Registrar {
    /// The second value is for [`Registrar::keep`].
    pub(crate) fn new(
        node: String,
        master_uri: String,
        api_uri: String,
        service_uri: String,
    ) -> (Self, mpsc::UnboundedReceiver<Key>) {
        let (released, withdrawals) = mpsc::unbounded_channel();
        let registrar = Self {
            node,
            master_uri,
            api_uri,
            service_uri,
            graph: Mutex::default(),
            online: watch::Sender::new(false),
            shutdown_requested: watch::Sender::new(false),
            released,
            mute: AtomicBool::new(false),
            conversation: tokio::sync::Mutex::default(),
        };
        (registrar, withdrawals)
    }

    /// Runs for as long as the node: asks the master, repairs what it has forgotten, and tells
    /// it what was dropped.
    pub(crate) async fn keep(self: Arc<Self>, mut withdrawals: mpsc::UnboundedReceiver<Key>) {
        let mut next = Instant::now();
        loop {
            tokio::select! {
                Some(key) = withdrawals.recv() => self.withdraw(&key).await,
                () = sleep_until(next) => {
                    let started = Instant::now();
                    // The refusals were logged; what is refused is tried again.
                    let _ = self.tend().await;
                    let online = *self.online.borrow();
                    next = started + if online { ONLINE_PERIOD } else { OFFLINE_PERIOD };
                }
            }
        }
    }

    /// Asks the master whether it knows us and registers all that it does not know. Returns what
    /// it refused, with its reasons; that it cannot be reached is no refusal.
    pub(crate) async fn tend(&self) -> Vec<(Key, CallError)> {
        let _conversation = self.conversation.lock().await;
        // Whoever took our name shall keep it: to register again would displace it in turn.
        if *self.shutdown_requested.borrow() {
            return Vec::new();
        }
        match self.call("lookupNode", &[self.node.as_str().into()]).await {
            Ok(uri) if uri.as_str() == Some(&self.api_uri) => {}
            Ok(uri) => {
                let mut graph = lock(&self.graph);
                if !graph.registered.is_empty() {
                    graph.registered.clear();
                    tracing::warn!(node = self.node, ?uri, "another node has taken this name");
                    self.shutdown_requested.send_replace(true);
                    return Vec::new();
                }
                // A predecessor's registration: ours will displace it.
            }
            Err(CallError::Refused { .. }) => lock(&self.graph).registered.clear(),
            Err(error) => {
                self.went_offline(&error);
                return Vec::new();
            }
        }
        let refused = self.register_missing().await;
        refused.unwrap_or_else(|error| {
            self.went_offline(&error);
            Vec::new()
        })
    }

    /// As [`Registrar::tend`], for who has just offered something: what a slow master does not
    /// answer in time is left to the keeper, a refusal of it to the log.
    pub(crate) async fn introduce(&self) -> Vec<(Key, CallError)> {
        if self.mute.load(Relaxed) {
            return Vec::new();
        }
        let refused = timeout(OFFER_LIMIT, self.tend()).await;
        refused.unwrap_or_else(|_| {
            self.mute.store(true, Relaxed);
            Vec::new()
        })
    }

    async fn register_missing(&self) -> Result<Vec<(Key, CallError)>, CallError> {
        let missing: Vec<Key> = {
            let graph = lock(&self.graph);
            graph
                .keys()
                .into_iter()
                .filter(|key| !graph.registered.contains(key))
                .collect()
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
                            "{key} was refused by the master: {error}; it is offered again every \
                             second"
                        );
                    }
                    refused.push((key, error));
                }
                Err(error) => return Err(error),
            }
        }
        if !self.online.send_replace(true) {
            tracing::info!(
                master = self.master_uri,
                "the master answers; all is registered"
            );
        }
        Ok(refused)
    }

    /// What was dropped while the master answered is not marked, and its withdrawal is already
    /// queued; nor is what was then offered anew under the same name: its own turn comes.
    async fn register(&self, key: &Key) -> Result<(), CallError> {
        let api = Value::from(self.api_uri.as_str());
        match key {
            Key::Publisher(name) => {
                let Some(topic) = lock(&self.graph).publishers.get(name).cloned() else {
                    return Ok(());
                };
                let arguments = [name.as_str().into(), topic.message_type.name.into(), api];
                self.call("registerPublisher", &arguments).await?;
                let mut graph = lock(&self.graph);
                if is_still(graph.publishers.get(name), &topic) {
                    graph.registered.insert(key.clone());
                }
            }
            Key::Subscriber(name) => {
                let Some(topic) = lock(&self.graph).subscribers.get(name).cloned() else {
                    return Ok(());
                };
                let arguments = [name.as_str().into(), topic.message_type.name.into(), api];
                let publishers = self.call("registerSubscriber", &arguments).await?;
                let mut graph = lock(&self.graph);
                if is_still(graph.subscribers.get(name), &topic) {
                    topic.add_publishers(&uris(&publishers));
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
                if is_still(graph.services.get(name), &provider) {
                    graph.registered.insert(key.clone());
                }
            }
        }
        Ok(())
    }

    /// Takes one thing out of the graph; the master is told soon.
    pub(crate) fn release(&self, key: &Key) {
        let mut graph = lock(&self.graph);
        if !graph.closed {
            graph.remove(key);
            graph.leaving.insert(key.clone());
            // Nobody receives once the node is gone.
            let _ = self.released.send(key.clone());
        }
    }

    async fn withdraw(&self, key: &Key) {
        let _conversation = self.conversation.lock().await;
        // Offered again since: the registration stands.
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
        self.call(method, &[name.as_str().into(), uri.as_str().into()])
            .await
    }

    /// Closes the graph and unregisters everything, within the time limit; also what was dropped just
    /// before, because the keeper ends.
    pub(crate) async fn farewell(&self) {
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
        let unregister_all = async {
            let _conversation = self.conversation.lock().await;
            for key in keys {
                if let Err(error) = self.unregister(&key).await {
                    tracing::debug!(node = self.node, "{key} could not be unregistered: {error}");
                    if !matches!(error, CallError::Refused { .. }) {
                        return;
                    }
                }
            }
        };
        if timeout(FAREWELL_LIMIT, unregister_all).await.is_err() {
            tracing::warn!(
                master = self.master_uri,
                "the master was too slow to unregister all"
            );
        }
    }

    async fn call(&self, method: &str, arguments: &[Value]) -> Result<Value, CallError> {
        let mut all = vec![Value::from(self.node.as_str())];
        all.extend_from_slice(arguments);
        let outcome = call_ros(&self.master_uri, method, &all).await;
        let mute = matches!(outcome, Err(CallError::Timeout { .. }));
        self.mute.store(mute, Relaxed);
        outcome
    }

    fn went_offline(&self, error: &CallError) {
        if self.online.send_replace(false) {
            tracing::warn!(master = self.master_uri, "the master is gone: {error}");
        }
    }
}

fn is_still<T>(now: Option<&Arc<T>>, then: &Arc<T>) -> bool {
    now.is_some_and(|now| Arc::ptr_eq(now, then))
}

/// The strings of an array of URIs.
pub(crate) fn uris(value: &Value) -> Vec<String> {
    let items = value.as_array().unwrap_or_default();
    items
        .iter()
        .filter_map(Value::as_str)
        .map(str::to_owned)
        .collect()
}
