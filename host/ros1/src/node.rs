//! The ROS 1 node: starts its servers and tasks, and adds topics and services to its graph.

mod acceptor;
mod graph;
pub(crate) mod handles;
pub(crate) mod options;
pub(crate) mod registrar;
mod slave;

use std::{io, net::IpAddr, sync::Arc};

use tokio::{net::TcpListener, sync::watch, task::JoinHandle};

use crate::{
    address::{Address, AddressError, listen_address, own_address},
    names::{NameError, Names},
    publication::{Publication, PublisherOptions},
    service::{Provider, ServiceClient, ServiceError},
    subscription::{Inbox, Subscription},
    sync::lock,
    tcpros::{MessageType, ServiceType},
    xmlrpc::{CallError, Server},
};
use graph::{Graph, Key};
use handles::{Lease, Publisher, Service, Subscriber};
use options::NodeOptions;
use registrar::{MasterStatus, Registrar, SystemState};
use slave::Slave;

/// Why a node could not be started, or why a topic or service could not be added to a node.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// A name violates the syntax of ROS graph names.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The master's URI is malformed.
    #[error("the master's URI cannot be used: {0}; set ROS_MASTER_URI")]
    MasterUri(#[from] AddressError),
    /// The node cannot listen on its address.
    #[error("cannot listen on {address}: {source}; set ROS_IP to an address of this machine")]
    Listen {
        /// Local IP address of the failed listener, derived from [`NodeOptions::host`].
        address: IpAddr,
        /// Error from the operating system.
        source: io::Error,
    },
    /// This node already has the topic or service. Holds the kind and the name of the duplicate.
    #[error("this node already has a {0}; clone that one, or drop it first")]
    Duplicate(String),
    /// The master refused the registration.
    #[error("the master refuses the {what}: {source}")]
    Refused {
        /// Kind (publisher, subscriber or service) and name of the refused registration.
        what: String,
        /// Status code and message that the master returned.
        source: CallError,
    },
    /// [`Node::shutdown`] has been called.
    #[error("the node has shut down; start another one")]
    ShutDown,
}

/// A node of the ROS graph.
///
/// A node needs no running master: it registers once a master answers, and again if the master has
/// lost the registration. Dropping the node closes its connections but leaves its registrations at
/// the master; [`Node::shutdown`] removes them.
#[derive(Debug)]
pub struct Node {
    registrar: Arc<Registrar>,
    names: Names,
    tasks: tokio::sync::Mutex<Tasks>,
    abort: [tokio::task::AbortHandle; 2],
}

#[derive(Debug)]
struct Tasks {
    server: Server,
    registration: JoinHandle<()>,
    listener: JoinHandle<()>,
    stop: watch::Sender<bool>,
}

impl Node {
    /// Opens the node's ports and registers with the master in the background.
    ///
    /// # Errors
    /// [`NodeError::Name`], [`NodeError::MasterUri`] or [`NodeError::Listen`].
    pub async fn start(options: NodeOptions) -> Result<Self, NodeError> {
        let names = options.names()?;
        let master = Address::parse(&options.master_uri)?;
        let host = match options.host {
            Some(host) => host.trim_matches(['[', ']']).to_owned(),
            None => own_address(&master).await.to_string(),
        };
        let address = listen_address(&host, options.ipv6);
        let listen = async || {
            let bound = TcpListener::bind((address, 0)).await;
            let bound = bound.and_then(|listener| Ok((listener.local_addr()?.port(), listener)));
            bound.map_err(|source| NodeError::Listen { address, source })
        };
        let (api_port, api_listener) = listen().await?;
        let (port, listener) = listen().await?;
        let (registrar, released_keys) = Registrar::new(
            names.node().to_owned(),
            options.master_uri,
            format!("http://{}/", Address::new(&host, api_port)),
            format!("rosrpc://{}", Address::new(&host, port)),
        );
        let registrar = Arc::new(registrar);
        let slave = Slave { registrar: Arc::downgrade(&registrar), host, port };
        let server =
            Server::start(api_listener, move |method, arguments| slave.answer(method, arguments));
        let (stop, stopped) = watch::channel(false);
        let listener = tokio::spawn(acceptor::accept(listener, Arc::clone(&registrar), stopped));
        let registration = tokio::spawn(Arc::clone(&registrar).run(released_keys));
        let abort = [listener.abort_handle(), registration.abort_handle()];
        let tasks = tokio::sync::Mutex::new(Tasks { server, registration, listener, stop });
        Ok(Self { registrar, names, tasks, abort })
    }

    /// Full name of the node, `/namespace/name`.
    pub fn name(&self) -> &str {
        self.names.node()
    }

    /// URI of this node's XML-RPC server, `http://HOST:PORT/`.
    pub fn uri(&self) -> &str {
        &self.registrar.api_uri
    }

    /// Returns the full name of `name` in this node after remapping.
    ///
    /// # Errors
    /// `name` violates the syntax of ROS graph names.
    pub fn resolve(&self, name: &str) -> Result<String, NameError> {
        self.names.resolve(name)
    }

    /// Advertises a topic. If no master answers within 2 s, the node registers the topic later.
    ///
    /// # Errors
    /// [`NodeError`] if the name is invalid, the node already publishes the topic, the node has
    /// shut down, or the master refuses the registration. If the master refuses a later
    /// registration, the node logs the refusal once and keeps trying.
    pub async fn advertise(
        &self,
        topic: &str,
        message_type: &'static MessageType,
        options: PublisherOptions,
    ) -> Result<Publisher, NodeError> {
        let name = self.names.resolve(topic)?;
        let key = Key::Publisher(name.clone());
        let publication = Arc::new(Publication::new(name.clone(), message_type, options));
        let added = Arc::clone(&publication);
        let insert = |graph: &mut Graph| drop(graph.publications.insert(name, added));
        Ok(Publisher { publication, _lease: Arc::new(self.add(key, insert).await?) })
    }

    /// Subscribes to a topic. Up to `queue` received messages wait to be read; each further message
    /// drops the oldest waiting one.
    ///
    /// # Errors
    /// [`NodeError`], under the same conditions as [`Node::advertise`].
    pub async fn subscribe(
        &self,
        topic: &str,
        message_type: &'static MessageType,
        queue: usize,
    ) -> Result<Subscriber, NodeError> {
        let name = self.names.resolve(topic)?;
        let key = Key::Subscriber(name.clone());
        let inbox = Inbox::new(name.clone(), message_type, self.name(), queue);
        let subscription = Arc::new(Subscription::new(inbox));
        let added = Arc::clone(&subscription);
        let insert = |graph: &mut Graph| drop(graph.subscriptions.insert(name, added));
        Ok(Subscriber { subscription, _lease: self.add(key, insert).await? })
    }

    /// Provides a service. `handler` computes the body of the response from the name of the calling
    /// node and the body of its request, or returns an error message for the caller. The handler
    /// runs on a separate thread and can block.
    ///
    /// # Errors
    /// [`NodeError`], under the same conditions as [`Node::advertise`].
    pub async fn serve(
        &self,
        name: &str,
        service_type: &'static ServiceType,
        handler: impl Fn(&str, &[u8]) -> Result<Vec<u8>, String> + Send + Sync + 'static,
    ) -> Result<Service, NodeError> {
        let name = self.names.resolve(name)?;
        let key = Key::Service(name.clone());
        let provider = Arc::new(Provider::new(name.clone(), service_type, Box::new(handler)));
        let insert = |graph: &mut Graph| drop(graph.services.insert(name, provider));
        Ok(Service { _lease: self.add(key, insert).await? })
    }

    /// Looks up a service, calls it once as [`ServiceClient::call`] does, and closes the
    /// connection.
    ///
    /// # Errors
    /// All variants of [`ServiceError`].
    pub async fn call(
        &self,
        service: &str,
        service_type: &ServiceType,
        request: &[u8],
    ) -> Result<Vec<u8>, ServiceError> {
        let service = self.names.resolve(service)?;
        let uri = &self.registrar.master_uri;
        let mut client =
            ServiceClient::connect(self.name(), uri, &service, service_type, false).await?;
        client.call(request).await
    }

    /// Looks up a service and opens a connection that can be used for any number of calls.
    ///
    /// # Errors
    /// All variants of [`ServiceError`] but [`ServiceError::Failed`].
    pub async fn connect(
        &self,
        service: &str,
        service_type: &ServiceType,
    ) -> Result<ServiceClient, ServiceError> {
        let service = self.names.resolve(service)?;
        let uri = &self.registrar.master_uri;
        ServiceClient::connect(self.name(), uri, &service, service_type, true).await
    }

    /// Returns a watch channel with what this node knows about its master.
    pub fn master_status(&self) -> watch::Receiver<MasterStatus> {
        self.registrar.master.subscribe()
    }

    /// Returns the publishers of subscribed topics that cannot be reached. Each entry holds the
    /// topic, and a text with the publisher's URI, the reason and what to do.
    pub fn unreachable_publishers(&self) -> Vec<(String, String)> {
        let graph = lock(&self.registrar.graph);
        let of_topic = graph.subscriptions.iter().flat_map(|(topic, subscription)| {
            let faults = subscription.unreachable().into_iter();
            faults.map(|fault| (topic.clone(), fault))
        });
        of_topic.collect()
    }

    /// Asks the master which nodes publish topics, subscribe to topics and provide services.
    ///
    /// # Errors
    /// All variants of [`CallError`].
    pub async fn system_state(&self) -> Result<SystemState, CallError> {
        self.registrar.system_state().await
    }

    /// Waits until the master asks this node to shut down, because of `rosnode kill` or because
    /// another node has taken its name. The node keeps running until [`Node::shutdown`] but does
    /// not register again.
    pub async fn shutdown_requested(&self) {
        let mut requested = self.registrar.shutdown_requested.subscribe();
        // Waiting cannot fail, because the sender lives as long as the node.
        let _ = requested.wait_for(|requested| *requested).await;
    }

    /// Unregisters all topics and services, sends queued messages for up to 0.5 s and closes every
    /// connection. Returns within 3 s. A second call does nothing.
    pub async fn shutdown(&self) {
        let mut tasks = self.tasks.lock().await;
        if lock(&self.registrar.graph).closed {
            return;
        }
        self.registrar.unregister_all().await;
        tasks.registration.abort();
        self.registrar.master.send_replace(MasterStatus::Unknown);
        tasks.stop.send_replace(true);
        // The listener task ends by itself; the join fails only if the task had already been
        // aborted.
        let _ = (&mut tasks.listener).await;
        tasks.server.stop().await;
    }

    /// Adds a topic or service to the graph by calling `insert`, and registers it. Fails if `key`
    /// is already in the graph or the node has shut down. If the master refuses the registration,
    /// removes the topic or service from the graph again, and fails.
    async fn add(&self, key: Key, insert: impl FnOnce(&mut Graph)) -> Result<Lease, NodeError> {
        let lease = {
            let mut graph = lock(&self.registrar.graph);
            if graph.closed {
                return Err(NodeError::ShutDown);
            }
            if graph.contains(&key) {
                return Err(NodeError::Duplicate(key.to_string()));
            }
            insert(&mut graph);
            Lease { key, registrar: Arc::downgrade(&self.registrar) }
        };
        let refused = self.registrar.sync_within_timeout().await;
        match refused.into_iter().find(|(key, _)| *key == lease.key) {
            Some((key, source)) => Err(NodeError::Refused { what: key.to_string(), source }),
            None => Ok(lease),
        }
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        for task in &self.abort {
            task.abort();
        }
        let mut graph = lock(&self.registrar.graph);
        graph.closed = true;
        for key in graph.keys() {
            graph.remove(&key);
        }
    }
}
