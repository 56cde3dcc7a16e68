//! The connection to one publisher: made again, with growing pauses, for as long as the
//! publisher is wanted.

use std::{
    io,
    sync::Arc,
    sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    time::Duration,
};

use tokio::{
    io::AsyncWriteExt as _,
    net::TcpStream,
    sync::Notify,
    time::{sleep, timeout},
};

use crate::{
    address::Address,
    subscriber::IncomingTopic,
    tcpros::{HANDSHAKE_LIMIT, Header, HeaderError, disagreement, read_block, set_options},
    xmlrpc::{CallError, Value, call_ros},
};

/// The pause after the first failure; it doubles with each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// The longest pause.
const LAST_PAUSE: Duration = Duration::from_secs(5);

/// One publisher of one topic.
#[derive(Debug)]
pub(crate) struct Inlet {
    /// Number of the connection within its topic.
    pub(crate) id: u32,
    /// Messages that came.
    pub(crate) messages: AtomicU64,
    /// Bytes of them, without their lengths.
    pub(crate) bytes: AtomicU64,
    uri: String,
    wanted: AtomicBool,
    connected: AtomicBool,
    retry: Notify,
}

/// Why a connection ended.
#[derive(Debug, thiserror::Error)]
enum InletError {
    #[error(transparent)]
    Call(#[from] CallError),
    #[error("the publisher offers no TCPROS address but {0:?}")]
    Offer(Value),
    #[error("the publisher's address cannot be reached: {0}")]
    Unreachable(io::Error),
    #[error(transparent)]
    Header(#[from] HeaderError),
    #[error("the publisher refuses: {0}")]
    Refused(String),
    #[error("{0}")]
    Disagreement(String),
    #[error("the connection broke: {0}")]
    Broken(io::Error),
}

impl Inlet {
    pub(crate) fn new(id: u32, uri: String) -> Self {
        Self {
            id,
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            uri,
            wanted: AtomicBool::new(true),
            connected: AtomicBool::new(false),
            retry: Notify::new(),
        }
    }

    /// The publisher's XML-RPC URI.
    pub(crate) fn uri(&self) -> &str {
        &self.uri
    }

    pub(crate) fn connected(&self) -> bool {
        self.connected.load(Relaxed)
    }

    pub(crate) fn wanted(&self) -> bool {
        self.wanted.load(Relaxed)
    }

    /// The master names the publisher: if it is not connected, now is the time to try.
    pub(crate) fn want(&self) {
        self.wanted.store(true, Relaxed);
        self.retry.notify_one();
    }

    /// The master does not name the publisher; true while the connection lives on.
    pub(crate) fn unwant(&self) -> bool {
        self.wanted.store(false, Relaxed);
        self.connected()
    }

    /// Runs until the publisher is no longer wanted; the topic aborts it when it closes.
    pub(crate) async fn run(self: Arc<Self>, topic: Arc<IncomingTopic>) {
        let mut pause = FIRST_PAUSE;
        loop {
            let before = self.messages.load(Relaxed);
            let outcome = self.receive(&topic).await;
            self.connected.store(false, Relaxed);
            match outcome {
                Ok(()) => return,
                Err(error @ (InletError::Refused(_) | InletError::Disagreement(_))) => {
                    tracing::warn!(topic = topic.name, publisher = self.uri, "{error}");
                }
                Err(error) => {
                    tracing::debug!(topic = topic.name, publisher = self.uri, "{error}");
                }
            }
            if topic.forget_unwanted(&self) {
                return;
            }
            if self.messages.load(Relaxed) != before {
                pause = FIRST_PAUSE;
            }
            tokio::select! {
                () = sleep(pause) => pause = (pause * 2).min(LAST_PAUSE),
                // Named again by the master: one early try.
                () = self.retry.notified() => {}
            }
        }
    }

    /// One connection, from the request to its end. `Ok`: nobody takes messages any more.
    async fn receive(&self, topic: &IncomingTopic) -> Result<(), InletError> {
        let protocols = Value::from([Value::from(["TCPROS"])]);
        let arguments = [
            Value::from(topic.node()),
            topic.name.as_str().into(),
            protocols,
        ];
        let offer = call_ros(&self.uri, "requestTopic", &arguments).await?;
        let address = tcpros_address(&offer).ok_or(InletError::Offer(offer))?;
        let connect = TcpStream::connect((address.host(), address.port()));
        let connected = timeout(HANDSHAKE_LIMIT, connect).await;
        let mut stream = connected
            .map_err(|_| InletError::Unreachable(io::ErrorKind::TimedOut.into()))?
            .map_err(InletError::Unreachable)?;
        set_options(&stream).map_err(InletError::Broken)?;
        let ours = topic.message_type;
        let request = Header::new()
            .with("callerid", topic.node())
            .with("md5sum", ours.md5)
            .with("message_definition", ours.definition)
            .with("tcp_nodelay", "1")
            .with("topic", &topic.name)
            .with("type", ours.name)
            .encode()?;
        stream
            .write_all(&request)
            .await
            .map_err(InletError::Broken)?;
        let header = Header::read(&mut stream).await?;
        if let Some(error) = header.get("error") {
            return Err(InletError::Refused(error.to_owned()));
        }
        let what = format!("topic [{}] of {}", topic.name, self.uri);
        if let Some(difference) = disagreement(&header, &what, ours.name, ours.md5) {
            return Err(InletError::Disagreement(difference));
        }
        self.connected.store(true, Relaxed);
        loop {
            let message = read_block(&mut stream).await.map_err(InletError::Broken)?;
            self.messages.fetch_add(1, Relaxed);
            self.bytes
                .fetch_add(u64::try_from(message.len()).unwrap_or(u64::MAX), Relaxed);
            if !topic.deliver(message) {
                return Ok(());
            }
        }
    }
}

/// `["TCPROS", host, port]`.
fn tcpros_address(offer: &Value) -> Option<Address> {
    match offer.as_array()? {
        [protocol, host, port, ..] if protocol.as_str() == Some("TCPROS") => Some(Address::new(
            host.as_str()?,
            u16::try_from(port.as_int()?).ok()?,
        )),
        _ => None,
    }
}
