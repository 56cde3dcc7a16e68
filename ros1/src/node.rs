//! A ROS 1 node.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    sync::Arc,
};

use tokio::{
    net::{TcpListener, UdpSocket},
    sync::watch,
    task::JoinHandle,
};

use crate::{
    address::{Address, AddressError},
    graph::{Graph, Key, Lease},
    incoming,
    lock::lock,
    message_type::{MessageType, ServiceType},
    names::{NameError, Names},
    options::NodeOptions,
    publisher::{OutgoingTopic, Publisher, PublisherOptions},
    registrar::Registrar,
    service::{Provider, Service},
    service_client::{ServiceClient, ServiceError},
    slave::Slave,
    subscriber::{IncomingTopic, Subscriber},
    xmlrpc::{CallError, Server},
};

/// Why a node, a topic or a service cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// A name is not a ROS name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The master's URI cannot be read.
    #[error("the master's URI cannot be used: {0}; set ROS_MASTER_URI")]
    MasterUri(#[from] AddressError),
    /// No port to listen on.
    #[error("cannot listen on {address}: {source}; set ROS_IP to an address of this machine")]
    Listen {
        /// Where.
        address: IpAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The node has it already.
    #[error("this node has a {0} already; clone that one, or drop it first")]
    Taken(String),
    /// The master refuses it.
    #[error("the master refuses the {what}: {source}")]
    Refused {
        /// Publisher, subscriber or service, and its name.
        what: String,
        /// The master's words.
        source: CallError,
    },
    /// The node has shut down.
    #[error("the node has shut down; start another one")]
    ShutDown,
}

/// A node of the ROS graph. It needs no living master: it registers as soon as there is one, and
/// again whenever the master has forgotten it. Dropping it ends its connections without telling
/// the master; [`Node::shutdown`] tells it.
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
    keeper: JoinHandle<()>,
    listener: JoinHandle<()>,
    stop: watch::Sender<bool>,
}

impl Node {
    /// Opens the node's ports and starts looking for the master.
    ///
    /// # Errors
    /// A name or the master's URI cannot be used, or no port can be opened.
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
        let (registrar, withdrawals) = Registrar::new(
            names.node().to_owned(),
            options.master_uri,
            format!("http://{}/", Address::new(&host, api_port)),
            format!("rosrpc://{}", Address::new(&host, port)),
        );
        let registrar = Arc::new(registrar);
        let slave = Slave {
            registrar: Arc::downgrade(&registrar),
            host,
            port,
        };
        let server = Server::start(api_listener, move |method, arguments| {
            slave.answer(method, arguments)
        });
        let (stop, stopped) = watch::channel(false);
        let listener = tokio::spawn(incoming::accept(listener, Arc::clone(&registrar), stopped));
        let keeper = tokio::spawn(Arc::clone(&registrar).keep(withdrawals));
        let abort = [listener.abort_handle(), keeper.abort_handle()];
        let tasks = tokio::sync::Mutex::new(Tasks {
            server,
            keeper,
            listener,
            stop,
        });
        Ok(Self {
            registrar,
            names,
            tasks,
            abort,
        })
    }

    /// The node's full name.
    pub fn name(&self) -> &str {
        self.names.node()
    }

    /// The URI of the node's XML-RPC server.
    pub fn uri(&self) -> &str {
        &self.registrar.api_uri
    }

    /// A name as this node sees it: full and remapped.
    ///
    /// # Errors
    /// `name` is not a ROS name.
    pub fn resolve(&self, name: &str) -> Result<String, NameError> {
        self.names.resolve(name)
    }

    /// Publishes a topic. Without a master, or with one that does not answer within 2 s, it is
    /// registered later.
    ///
    /// # Errors
    /// The name cannot be used, the node publishes the topic already, or the master refuses it. A
    /// later registration that is refused is tried again and logged once.
    pub async fn advertise(
        &self,
        topic: &str,
        message_type: &'static MessageType,
        options: PublisherOptions,
    ) -> Result<Publisher, NodeError> {
        let name = self.names.resolve(topic)?;
        let key = Key::Publisher(name.clone());
        let topic = Arc::new(OutgoingTopic::new(name.clone(), message_type, options));
        let lease = self.offer(key, |graph| {
            graph.publishers.insert(name, Arc::clone(&topic));
        })?;
        Ok(Publisher::new(topic, self.register(lease).await?))
    }

    /// Subscribes to a topic; `queue` messages wait to be taken, one more drops the oldest.
    ///
    /// # Errors
    /// As [`Node::advertise`].
    pub async fn subscribe(
        &self,
        topic: &str,
        message_type: &'static MessageType,
        queue: usize,
    ) -> Result<Subscriber, NodeError> {
        let name = self.names.resolve(topic)?;
        let key = Key::Subscriber(name.clone());
        let topic = IncomingTopic::new(name.clone(), message_type, self.name(), queue);
        let topic = Arc::new(topic);
        let lease = self.offer(key, |graph| {
            graph.subscribers.insert(name, Arc::clone(&topic));
        })?;
        Ok(Subscriber::new(topic, self.register(lease).await?))
    }

    /// Provides a service. `handler` gets a request's body and gives the response's, or words
    /// for the caller why not; it runs on a thread of its own and may block.
    ///
    /// # Errors
    /// As [`Node::advertise`].
    pub async fn serve(
        &self,
        name: &str,
        service_type: &'static ServiceType,
        handler: impl Fn(&[u8]) -> Result<Vec<u8>, String> + Send + Sync + 'static,
    ) -> Result<Service, NodeError> {
        let name = self.names.resolve(name)?;
        let key = Key::Service(name.clone());
        let provider = Arc::new(Provider::new(name.clone(), service_type, Box::new(handler)));
        let lease = self.offer(key, |graph| {
            graph.services.insert(name, Arc::clone(&provider));
        })?;
        Ok(Service::new(provider, self.register(lease).await?))
    }

    /// Calls a service once, see [`ServiceClient::call`].
    ///
    /// # Errors
    /// The service cannot be found or reached, refuses, or fails.
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

    /// Connects to a service for many calls.
    ///
    /// # Errors
    /// The service cannot be found or reached, or refuses.
    pub async fn connect(
        &self,
        service: &str,
        service_type: &ServiceType,
    ) -> Result<ServiceClient, ServiceError> {
        let service = self.names.resolve(service)?;
        let uri = &self.registrar.master_uri;
        ServiceClient::connect(self.name(), uri, &service, service_type, true).await
    }

    /// Whether the master answers and knows everything this node has.
    pub fn master_online(&self) -> watch::Receiver<bool> {
        self.registrar.online.subscribe()
    }

    /// Waits until the master asks this node to end: `rosnode kill`, or a node of the same name
    /// has taken its place. The node goes on until [`Node::shutdown`], but registers no more.
    pub async fn shutdown_requested(&self) {
        let mut requested = self.registrar.shutdown_requested.subscribe();
        // The sender lives as long as the node.
        let _ = requested.wait_for(|requested| *requested).await;
    }

    /// Unregisters everything, lets the queues run dry for half a second, closes every
    /// connection. Takes 3 s at most. A second call does nothing.
    pub async fn shutdown(&self) {
        let mut tasks = self.tasks.lock().await;
        if lock(&self.registrar.graph).closed {
            return;
        }
        self.registrar.farewell().await;
        tasks.keeper.abort();
        self.registrar.online.send_replace(false);
        tasks.stop.send_replace(true);
        // Both end by themselves; a failure would only say that they already had.
        let _ = (&mut tasks.listener).await;
        tasks.server.stop().await;
    }

    /// Puts a thing into the graph, unless it is there or the node has shut down.
    fn offer(&self, key: Key, put: impl FnOnce(&mut Graph)) -> Result<Lease, NodeError> {
        let mut graph = lock(&self.registrar.graph);
        if graph.closed {
            return Err(NodeError::ShutDown);
        }
        if graph.contains(&key) {
            return Err(NodeError::Taken(key.to_string()));
        }
        put(&mut graph);
        Ok(Lease::new(key, &self.registrar))
    }

    /// Tells the master about what is new. When it refuses, the lease takes the thing back out.
    async fn register(&self, lease: Lease) -> Result<Lease, NodeError> {
        let refused = self.registrar.introduce().await;
        match refused.into_iter().find(|(key, _)| key == lease.key()) {
            Some((key, source)) => Err(NodeError::Refused {
                what: key.to_string(),
                source,
            }),
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

/// Where to listen so that peers who call `host` arrive, and nobody else where it is local.
fn listen_address(host: &str, ipv6: bool) -> IpAddr {
    match host.parse::<IpAddr>() {
        Ok(address) if address.is_loopback() => address,
        Ok(IpAddr::V6(_)) => Ipv6Addr::UNSPECIFIED.into(),
        Err(_) if host == "localhost" => Ipv4Addr::LOCALHOST.into(),
        Err(_) if ipv6 => Ipv6Addr::UNSPECIFIED.into(),
        Ok(IpAddr::V4(_)) | Err(_) => Ipv4Addr::UNSPECIFIED.into(),
    }
}

/// The address of the interface that leads to the master: what the master can call back. Without
/// a route to it, that of the default route (192.0.2.1 is TEST-NET-1, RFC 5737), else loopback.
/// Connecting a UDP socket sends nothing.
async fn own_address(master: &Address) -> IpAddr {
    for (host, port) in [(master.host(), master.port()), ("192.0.2.1", 9)] {
        let Ok(targets) = tokio::net::lookup_host((host, port)).await else {
            continue;
        };
        // Most ROS 1 peers speak IPv4 only, and "localhost" is both.
        let mut targets: Vec<SocketAddr> = targets.collect();
        targets.sort_by_key(SocketAddr::is_ipv6);
        for target in targets {
            if let Ok(address) = towards(target).await {
                return address;
            }
        }
    }
    tracing::warn!("no route to the master; set ROS_IP, or other machines cannot reach this node");
    Ipv4Addr::LOCALHOST.into()
}

async fn towards(target: SocketAddr) -> io::Result<IpAddr> {
    let any: IpAddr = match target {
        SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
        SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
    };
    let socket = UdpSocket::bind((any, 0)).await?;
    socket.connect(target).await?;
    Ok(socket.local_addr()?.ip())
}
