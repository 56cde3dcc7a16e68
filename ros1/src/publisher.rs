//! Topics going out.

use std::{
    net::SocketAddr,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU32, AtomicU64, Ordering::Relaxed},
    },
};

use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};

use crate::{
    drop_oldest::{DropOldest, Put},
    graph::Lease,
    lock::lock,
    message_type::MessageType,
    tcpros::{Header, HeaderError, MAX_MESSAGE, disagreement, write_block},
};

/// How a topic is published.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PublisherOptions {
    /// Messages waiting per subscriber; one more drops that subscriber's oldest. 0 counts as 1.
    pub queue: usize,
    /// A new subscriber gets the last message at once.
    pub latch: bool,
}

/// A topic that this node publishes. Clones are the same topic; it is withdrawn when the last
/// one is dropped.
#[derive(Debug, Clone)]
pub struct Publisher {
    topic: Arc<OutgoingTopic>,
    _lease: Arc<Lease>,
}

impl Publisher {
    pub(crate) fn new(topic: Arc<OutgoingTopic>, lease: Lease) -> Self {
        Self {
            topic,
            _lease: Arc::new(lease),
        }
    }

    /// Hands one message body to every subscriber's queue and returns to how many. Never waits:
    /// one allocation that all share, none when nobody listens; a full queue loses its oldest
    /// message, which [`Publisher::dropped`] counts, and so is a body beyond
    /// [`MAX_MESSAGE`].
    pub fn publish(&self, message: &[u8]) -> u32 {
        self.topic.publish(message)
    }

    /// Subscribers connected now.
    pub fn subscribers(&self) -> usize {
        lock(&self.topic.state).outlets.len()
    }

    /// Messages dropped so far, summed over all subscribers that ever were.
    pub fn dropped(&self) -> u64 {
        self.topic.dropped.load(Relaxed)
    }

    /// The topic's full name, remapped.
    pub fn topic(&self) -> &str {
        &self.topic.name
    }
}

/// One topic of the node's, with a queue for each subscriber.
#[derive(Debug)]
pub(crate) struct OutgoingTopic {
    pub(crate) name: String,
    pub(crate) message_type: &'static MessageType,
    options: PublisherOptions,
    state: Mutex<State>,
    dropped: AtomicU64,
    next_id: AtomicU32,
}

#[derive(Debug, Default)]
struct State {
    latched: Option<Arc<[u8]>>,
    outlets: Vec<Arc<Outlet>>,
    closed: bool,
}

/// The way to one subscriber.
#[derive(Debug)]
pub(crate) struct Outlet {
    /// Number of the connection within its topic.
    pub(crate) id: u32,
    /// The subscriber's name, as it says.
    pub(crate) caller: String,
    /// Its address.
    pub(crate) peer: SocketAddr,
    /// Messages handed to the system.
    pub(crate) messages: AtomicU64,
    /// Bytes of them, without their lengths.
    pub(crate) bytes: AtomicU64,
    queue: DropOldest<Arc<[u8]>>,
}

impl OutgoingTopic {
    pub(crate) fn new(
        name: String,
        message_type: &'static MessageType,
        options: PublisherOptions,
    ) -> Self {
        Self {
            name,
            message_type,
            options,
            state: Mutex::default(),
            dropped: AtomicU64::new(0),
            next_id: AtomicU32::new(0),
        }
    }

    fn publish(&self, message: &[u8]) -> u32 {
        if message.len() > MAX_MESSAGE {
            self.dropped.fetch_add(1, Relaxed);
            return 0;
        }
        let mut state = lock(&self.state);
        if state.closed || (state.outlets.is_empty() && !self.options.latch) {
            return 0;
        }
        let shared: Arc<[u8]> = Arc::from(message);
        let mut reached = 0;
        for outlet in &state.outlets {
            match outlet.queue.put(Arc::clone(&shared)) {
                Put::Kept => reached += 1,
                Put::DroppedOldest => {
                    reached += 1;
                    self.dropped.fetch_add(1, Relaxed);
                }
                Put::Closed => {}
            }
        }
        if self.options.latch {
            state.latched = Some(shared);
        }
        reached
    }

    /// The connections of now.
    pub(crate) fn outlets(&self) -> Vec<Arc<Outlet>> {
        lock(&self.state).outlets.clone()
    }

    /// No new subscriber, no new message; what is queued still goes out.
    pub(crate) fn close(&self) {
        let mut state = lock(&self.state);
        state.closed = true;
        for outlet in &state.outlets {
            outlet.queue.close();
        }
    }

    /// Carries the topic to one subscriber, whose header has been read, until either side ends.
    pub(crate) async fn serve(
        self: Arc<Self>,
        mut stream: TcpStream,
        header: &Header,
        node: &str,
    ) -> Result<(), HeaderError> {
        let what = format!("topic [{}]", self.name);
        let (name, md5) = (self.message_type.name, self.message_type.md5);
        if let Some(difference) = disagreement(header, &what, name, md5) {
            tracing::warn!(subscriber = header.get("callerid"), "refused: {difference}");
            let refusal = Header::new().with("error", &difference).encode()?;
            stream.write_all(&refusal).await?;
            return Ok(stream.shutdown().await?);
        }
        let answer = Header::new()
            .with("callerid", node)
            .with("latching", if self.options.latch { "1" } else { "0" })
            .with("md5sum", md5)
            .with("message_definition", self.message_type.definition)
            .with("topic", &self.name)
            .with("type", name)
            .encode()?;
        let caller = header.get("callerid").unwrap_or("unknown").to_owned();
        let attached = self.attach(caller, stream.peer_addr()?);
        stream.write_all(&answer).await?;
        attached.outlet.carry(stream).await?;
        Ok(())
    }

    /// From here on the subscriber misses nothing: the latched message is in its queue first.
    fn attach(self: &Arc<Self>, caller: String, peer: SocketAddr) -> Attached {
        let outlet = Arc::new(Outlet {
            id: self.next_id.fetch_add(1, Relaxed),
            caller,
            peer,
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            queue: DropOldest::new(self.options.queue),
        });
        let mut state = lock(&self.state);
        if let Some(latched) = &state.latched {
            outlet.queue.put(Arc::clone(latched));
        }
        if state.closed {
            outlet.queue.close();
        }
        state.outlets.push(Arc::clone(&outlet));
        Attached {
            topic: Arc::clone(self),
            outlet,
        }
    }
}

/// Takes its outlet off the topic when the connection ends, however it ends.
struct Attached {
    topic: Arc<OutgoingTopic>,
    outlet: Arc<Outlet>,
}

impl Drop for Attached {
    fn drop(&mut self) {
        lock(&self.topic.state)
            .outlets
            .retain(|outlet| !Arc::ptr_eq(outlet, &self.outlet));
    }
}

impl Outlet {
    async fn carry(&self, mut stream: TcpStream) -> std::io::Result<()> {
        // A subscriber sends nothing after its header; reading tells when it goes.
        let mut ignored = [0; 64];
        loop {
            tokio::select! {
                message = self.queue.take() => {
                    let Some(message) = message else { return stream.shutdown().await };
                    write_block(&mut stream, &message).await?;
                    self.messages.fetch_add(1, Relaxed);
                    self.bytes.fetch_add(u64::try_from(message.len()).unwrap_or(u64::MAX), Relaxed);
                }
                count = stream.read(&mut ignored) => if count? == 0 { return Ok(()) },
            }
        }
    }
}
