//! The link from a subscribed topic to one of its publishers.

use std::{
    io,
    sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
};

use tokio::{io::AsyncWriteExt as _, net::TcpStream, sync::Notify, time::timeout};

use super::inbox::Inbox;
use crate::{
    address::Address,
    tcpros::{HANDSHAKE_TIMEOUT, Header, HeaderError, read_message, set_options, type_mismatch},
    xmlrpc::{CallError, Value, call_ros},
};

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
    listed: AtomicBool,
    connected: AtomicBool,
    retry: Notify,
}

/// Why a connection to a publisher ended.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LinkError {
    #[error(transparent)]
    Call(#[from] CallError),
    #[error("the publisher offers no TCPROS address; is it a ROS 1 node?")]
    Offer,
    #[error("the publisher's address cannot be reached: {0}")]
    Unreachable(io::Error),
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
            retry: Notify::new(),
        }
    }

    /// The publisher's XML-RPC URI.
    pub(crate) fn uri(&self) -> &str {
        &self.uri
    }

    /// Returns whether a connection is open and both sides have exchanged valid headers.
    pub(crate) fn is_connected(&self) -> bool {
        self.connected.load(Relaxed)
    }

    /// Returns whether the master's latest list of publishers contains this one.
    pub(crate) fn is_listed(&self) -> bool {
        self.listed.load(Relaxed)
    }

    /// Marks the publisher as listed by the master and wakes a waiting [`Self::retry_requested`].
    pub(crate) fn mark_listed(&self) {
        self.listed.store(true, Relaxed);
        self.retry.notify_one();
    }

    /// Marks the publisher as no longer listed by the master.
    pub(crate) fn mark_unlisted(&self) {
        self.listed.store(false, Relaxed);
    }

    /// Waits until [`Self::mark_listed`] is called.
    pub(crate) async fn retry_requested(&self) {
        self.retry.notified().await;
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
        let arguments = [
            Value::from(inbox.node.as_str()),
            inbox.topic.as_str().into(),
            protocols,
        ];
        let offer = call_ros(&self.uri, "requestTopic", &arguments).await?;
        let address = tcpros_address(&offer).ok_or(LinkError::Offer)?;
        let connect = TcpStream::connect((address.host(), address.port()));
        let connected = timeout(HANDSHAKE_TIMEOUT, connect).await;
        let mut stream = connected
            .map_err(|_| LinkError::Unreachable(io::ErrorKind::TimedOut.into()))?
            .map_err(LinkError::Unreachable)?;
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
        stream
            .write_all(&request)
            .await
            .map_err(LinkError::Broken)?;
        let header = Header::read(&mut stream).await?;
        if let Some(error) = header.get("error") {
            return Err(LinkError::Refused(error.to_owned()));
        }
        let what = format!("topic [{}] of {}", inbox.topic, self.uri);
        if let Some(mismatch) = type_mismatch(&header, &what, ours.name, ours.md5) {
            return Err(LinkError::TypeMismatch(mismatch));
        }
        self.connected.store(true, Relaxed);
        loop {
            let message = read_message(&mut stream).await.map_err(LinkError::Broken)?;
            self.messages.fetch_add(1, Relaxed);
            self.bytes
                .fetch_add(u64::try_from(message.len()).unwrap_or(u64::MAX), Relaxed);
            if !inbox.deliver(message) {
                return Ok(());
            }
        }
    }
}

/// Extracts the address from a publisher's answer to `requestTopic`: `["TCPROS", host, port]`.
fn tcpros_address(offer: &Value) -> Option<Address> {
    match offer.as_array()? {
        [protocol, host, port, ..] if protocol.as_str() == Some("TCPROS") => Some(Address::new(
            host.as_str()?,
            u16::try_from(port.as_int()?).ok()?,
        )),
        _ => None,
    }
}
