//! A subscribed topic: its inbox and a link to each publisher.

use std::{
    collections::HashMap,
    io,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed},
    },
    time::Duration,
};

use tokio::{
    io::AsyncWriteExt as _,
    sync::Notify,
    task::AbortHandle,
    time::{sleep, timeout},
};

use crate::{
    address::{Address, ConnectError},
    sync::{DropOldestQueue, Push, lock},
    tcpros::{
        HANDSHAKE_TIMEOUT, Header, HeaderError, MessageType, read_message, set_options,
        type_mismatch,
    },
    xmlrpc::{CallError, CallFailure, Value, call_ros},
};

/// Delay before the first attempt to reconnect to a publisher; doubles after each further failure.
const FIRST_RETRY_DELAY: Duration = Duration::from_millis(100);
/// Longest delay before an attempt to reconnect to a publisher.
const MAX_RETRY_DELAY: Duration = Duration::from_secs(5);
/// Number of consecutive failures, within about 0.3 s, after which a publisher counts as
/// unreachable. One failure is normal: a publisher that ends closes its connections before the
/// master unlists it.
const FAILURES_TO_REPORT: u32 = 3;

/// One topic that the node subscribes to. Its links are keyed by the publishers' XML-RPC URIs.
#[derive(Debug)]
pub(crate) struct Subscription {
    pub(crate) inbox: Inbox,
    links: Mutex<HashMap<String, RunningLink>>,
    next_id: AtomicU32,
}

#[derive(Debug)]
struct RunningLink {
    link: Arc<PublisherLink>,
    task: AbortHandle,
}

impl Subscription {
    pub(crate) fn new(inbox: Inbox) -> Self {
        Self { inbox, links: Mutex::default(), next_id: AtomicU32::new(0) }
    }

    /// Returns the links to all publishers, whether connected or waiting to reconnect.
    pub(crate) fn links(&self) -> Vec<Arc<PublisherLink>> {
        lock(&self.links).values().map(|running| Arc::clone(&running.link)).collect()
    }

    /// Returns the publishers that cannot be reached: URI, reason and remedy of each.
    pub(crate) fn unreachable(&self) -> Vec<String> {
        let links = lock(&self.links);
        links.values().filter_map(|running| running.link.fault()).collect()
    }

    /// Connects to each of `publishers` that has no link yet. Removes no link, because a restarted
    /// master lists only publishers that have registered again.
    pub(crate) fn add_publishers(self: &Arc<Self>, publishers: &[String]) {
        let mut links = lock(&self.links);
        for uri in publishers {
            if let Some(running) = links.get(uri) {
                running.link.mark_listed();
                continue;
            }
            let id = self.next_id.fetch_add(1, Relaxed);
            let link = Arc::new(PublisherLink::new(id, uri.clone()));
            let run = Arc::clone(self).run_link(Arc::clone(&link));
            let task = tokio::spawn(run).abort_handle();
            links.insert(uri.clone(), RunningLink { link, task });
        }
    }

    /// Replaces the list of publishers with the master's list. A publisher that is not in the list
    /// is not reconnected, but its open connection is kept until the publisher closes it.
    pub(crate) fn set_publishers(self: &Arc<Self>, publishers: &[String]) {
        lock(&self.links).retain(|uri, running| {
            if publishers.contains(uri) {
                return true;
            }
            running.link.listed.store(false, Relaxed);
            if running.link.is_connected() {
                return true;
            }
            running.task.abort();
            running.link.log_end(&self.inbox.topic);
            false
        });
        self.add_publishers(publishers);
    }

    /// Closes the connections to all publishers. Messages already received stay in the inbox.
    pub(crate) fn close(&self) {
        for (_, running) in lock(&self.links).drain() {
            running.task.abort();
        }
        self.inbox.messages.close();
    }

    /// Receives from one publisher and reconnects after failures. Ends when the inbox closes or the
    /// master no longer lists the publisher.
    async fn run_link(self: Arc<Self>, link: Arc<PublisherLink>) {
        let mut delay = FIRST_RETRY_DELAY;
        let mut failures = 0;
        loop {
            let messages_before = link.messages.load(Relaxed);
            let Err(error) = link.receive(&self.inbox).await else {
                return;
            };
            if self.remove_if_unlisted(&link) {
                return;
            }
            if link.messages.load(Relaxed) != messages_before {
                delay = FIRST_RETRY_DELAY;
                failures = 0;
            }
            failures += 1;
            if failures >= FAILURES_TO_REPORT || error.is_refusal() {
                link.report(&self.inbox.topic, &error);
            }
            tokio::select! {
                () = sleep(delay) => delay = (delay * 2).min(MAX_RETRY_DELAY),
                // The master has listed the publisher again: reconnect without further delay.
                () = link.retry.notified() => {}
            }
        }
    }

    /// Removes the link to a publisher without an open connection, unless the master lists that
    /// publisher. Returns whether the link was removed.
    fn remove_if_unlisted(&self, link: &PublisherLink) -> bool {
        let mut links = lock(&self.links);
        let listed = link.listed.load(Relaxed);
        if !listed {
            links.remove(link.uri());
            link.log_end(&self.inbox.topic);
        }
        !listed
    }
}

/// Received messages of a topic from all its publishers, in one queue; also the topic's name and
/// type.
#[derive(Debug)]
pub(crate) struct Inbox {
    /// Full name of the topic.
    pub(crate) topic: String,
    /// Message type that every publisher of the topic must have.
    pub(crate) message_type: &'static MessageType,
    /// Full name of the subscribing node.
    pub(crate) node: String,
    pub(crate) messages: DropOldestQueue<Vec<u8>>,
    /// Number of messages dropped because the queue was full.
    pub(crate) dropped: AtomicU64,
}

impl Inbox {
    /// Creates an inbox that holds at most `queue` messages.
    pub(crate) fn new(
        topic: String,
        message_type: &'static MessageType,
        node: &str,
        queue: usize,
    ) -> Self {
        Self {
            topic,
            message_type,
            node: node.to_owned(),
            messages: DropOldestQueue::new(queue),
            dropped: AtomicU64::new(0),
        }
    }

    /// Queues a received message body. Returns false if the inbox is closed.
    pub(crate) fn deliver(&self, message: Vec<u8>) -> bool {
        match self.messages.push(message) {
            Push::Queued => true,
            Push::DroppedOldest => {
                self.dropped.fetch_add(1, Relaxed);
                true
            }
            Push::Closed => false,
        }
    }
}

/// State of the link to one publisher, kept across reconnections.
#[derive(Debug)]
pub(crate) struct PublisherLink {
    /// ID of the link: 0 for the topic's first publisher, 1 for the second, and so on.
    pub(crate) id: u32,
    /// Number of messages received, summed over all connections to this publisher.
    pub(crate) messages: AtomicU64,
    /// Total size of the message bodies received, bytes.
    pub(crate) bytes: AtomicU64,
    uri: String,
    /// Whether the master's latest list of publishers contains this publisher.
    listed: AtomicBool,
    connected: AtomicBool,
    /// Why the publisher cannot be reached; `None` if it can.
    fault: Mutex<Option<String>>,
    retry: Notify,
}

/// Why a connection to a publisher ended.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LinkError {
    #[error(transparent)]
    Call(#[from] CallError),
    #[error("the publisher offers no TCPROS address; is it a ROS 1 node?")]
    Offer,
    #[error("it sends messages at {address}, which cannot be reached: {source}")]
    Unreachable { address: Address, source: ConnectError },
    #[error(transparent)]
    Header(#[from] HeaderError),
    #[error("the publisher refuses: {0}")]
    Refused(String),
    #[error("{0}")]
    TypeMismatch(String),
    #[error("the connection broke: {0}")]
    Broken(io::Error),
}

impl LinkError {
    /// Returns true if the publisher refused the connection or the two sides disagree on the
    /// topic's type. The user must resolve these errors; all others can be temporary.
    pub(crate) fn is_refusal(&self) -> bool {
        matches!(self, Self::Refused(_) | Self::TypeMismatch(_))
    }

    /// Returns advice to the user on how to resolve this error.
    fn remedy(&self) -> &'static str {
        match self {
            Self::Call(CallError::Failed { failure: CallFailure::Lookup(_), .. })
            | Self::Unreachable { source: ConnectError::Lookup(_), .. } => {
                "set ROS_IP where the publisher runs and restart it, or add its name to /etc/hosts \
                 of this machine"
            }
            Self::TypeMismatch(_) => "remap the topic, or build both nodes with the same messages",
            Self::Refused(_) | Self::Offer => "remap the topic, or stop the publisher",
            Self::Call(_) | Self::Unreachable { .. } | Self::Header(_) | Self::Broken(_) => {
                "if the publisher has ended, run: rosnode cleanup; if it runs on another machine, \
                 check its ROS_IP and the firewall"
            }
        }
    }
}

impl PublisherLink {
    /// Creates a link to the publisher whose XML-RPC server is at `uri`. Does not connect.
    pub(crate) fn new(id: u32, uri: String) -> Self {
        Self {
            id,
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            uri,
            listed: AtomicBool::new(true),
            connected: AtomicBool::new(false),
            fault: Mutex::default(),
            retry: Notify::new(),
        }
    }

    /// The publisher's XML-RPC URI.
    pub(crate) fn uri(&self) -> &str {
        &self.uri
    }

    /// Returns why the publisher cannot be reached; `None` if it can.
    pub(crate) fn fault(&self) -> Option<String> {
        lock(&self.fault).clone()
    }

    /// Stores why the publisher cannot be reached. Logs the reason unless one was already stored.
    fn report(&self, topic: &str, error: &LinkError) {
        let fault = format!("{}: {error}; {}", self.uri, error.remedy());
        if lock(&self.fault).replace(fault.clone()).is_none() {
            tracing::warn!("no connection to a publisher of {topic}, trying again: {fault}");
        }
    }

    /// Logs that the publisher has gone, if it was reported as unreachable before.
    fn log_end(&self, topic: &str) {
        if lock(&self.fault).take().is_some() {
            tracing::info!("the publisher of {topic} at {} has gone", self.uri);
        }
    }

    /// Returns whether a connection is open and both sides have exchanged valid headers.
    pub(crate) fn is_connected(&self) -> bool {
        self.connected.load(Relaxed)
    }

    /// Marks the publisher as listed by the master and ends the delay before the next attempt to
    /// connect.
    fn mark_listed(&self) {
        self.listed.store(true, Relaxed);
        self.retry.notify_one();
    }

    /// Opens one connection and delivers its messages to `inbox` until the connection ends. Returns
    /// `Ok` if the inbox is closed.
    pub(crate) async fn receive(&self, inbox: &Inbox) -> Result<(), LinkError> {
        let outcome = self.connect_and_receive(inbox).await;
        self.connected.store(false, Relaxed);
        outcome
    }

    async fn connect_and_receive(&self, inbox: &Inbox) -> Result<(), LinkError> {
        let protocols = Value::from([Value::from(["TCPROS"])]);
        let arguments = [Value::from(inbox.node.as_str()), inbox.topic.as_str().into(), protocols];
        let offer = call_ros(&self.uri, "requestTopic", &arguments).await?;
        let address = tcpros_address(&offer).ok_or(LinkError::Offer)?;
        let connected = timeout(HANDSHAKE_TIMEOUT, address.connect()).await;
        let connected = connected.unwrap_or_else(|elapsed| Err(io::Error::from(elapsed).into()));
        let mut stream = connected.map_err(|source| LinkError::Unreachable { address, source })?;
        set_options(&stream).map_err(LinkError::Broken)?;
        let ours = inbox.message_type;
        let request = Header::new()
            .with("callerid", &inbox.node)
            .with("md5sum", ours.md5)
            .with("message_definition", ours.definition)
            .with("tcp_nodelay", "1")
            .with("topic", &inbox.topic)
            .with("type", ours.name)
            .encode()?;
        stream.write_all(&request).await.map_err(LinkError::Broken)?;
        let header = Header::read(&mut stream).await?;
        if let Some(error) = header.get("error") {
            return Err(LinkError::Refused(error.to_owned()));
        }
        let what = format!("topic [{}] of {}", inbox.topic, self.uri);
        if let Some(mismatch) = type_mismatch(&header, &what, ours.name, ours.md5) {
            return Err(LinkError::TypeMismatch(mismatch));
        }
        self.connected.store(true, Relaxed);
        if lock(&self.fault).take().is_some() {
            tracing::info!("connected to the publisher of {} at {}", inbox.topic, self.uri);
        }
        loop {
            let message = read_message(&mut stream).await.map_err(LinkError::Broken)?;
            self.messages.fetch_add(1, Relaxed);
            self.bytes.fetch_add(u64::try_from(message.len()).unwrap_or(u64::MAX), Relaxed);
            if !inbox.deliver(message) {
                return Ok(());
            }
        }
    }
}

/// Extracts the address from a publisher's answer to `requestTopic`: `["TCPROS", host, port]`.
fn tcpros_address(offer: &Value) -> Option<Address> {
    match offer.as_array()? {
        [protocol, host, port, ..] if protocol.as_str() == Some("TCPROS") => {
            Some(Address::new(host.as_str()?, u16::try_from(port.as_int()?).ok()?))
        }
        _ => None,
    }
}
