//! A published topic: its latched message, its subscribers, and a queue of messages for each.

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
    sync::{DropOldestQueue, Push, lock},
    tcpros::{Header, HeaderError, MAX_MESSAGE, MessageType, refuse, type_mismatch, write_message},
};

/// Queue length and latching of a published topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PublisherOptions {
    /// Capacity of each subscriber's queue, messages; 0 is raised to 1. A full queue drops its
    /// oldest message to queue a new one.
    pub queue: usize,
    /// Whether the last published message is also sent to each new subscriber.
    pub latch: bool,
}

/// Number of messages that wait for one subscriber of a topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SubscriberLag {
    /// Name of the subscribing node.
    pub subscriber: String,
    /// Number of messages in the queue, not counting those in the operating system's buffers.
    pub waiting: usize,
}

#[derive(Debug)]
pub(crate) struct Publication {
    /// Full name of the topic.
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
    links: Vec<Arc<SubscriberLink>>,
    closed: bool,
}

/// The connection to one subscriber of the topic, with its message queue and counters.
#[derive(Debug)]
pub(crate) struct SubscriberLink {
    /// ID of the link: 0 for the topic's first subscriber, 1 for the second, and so on.
    pub(crate) id: u32,
    /// Name of the subscribing node, from its connection header.
    pub(crate) caller: String,
    pub(crate) peer: SocketAddr,
    /// Number of messages written to the socket.
    pub(crate) messages: AtomicU64,
    /// Total size of the message bodies written to the socket, bytes.
    pub(crate) bytes: AtomicU64,
    queue: DropOldestQueue<Arc<[u8]>>,
}

impl Publication {
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

    /// Queues a message body for every subscriber and returns the number of subscribers. `own`
    /// receives a subscriber's name and can return a different body for that subscriber. If
    /// `message` is longer than [`MAX_MESSAGE`], drops it and returns 0.
    pub(crate) fn publish(
        &self,
        message: &[u8],
        mut own: impl FnMut(&str) -> Option<Vec<u8>>,
    ) -> u32 {
        if message.len() > MAX_MESSAGE {
            self.dropped.fetch_add(1, Relaxed);
            return 0;
        }
        let mut state = lock(&self.state);
        if state.closed || (state.links.is_empty() && !self.options.latch) {
            return 0;
        }
        let shared: Arc<[u8]> = Arc::from(message);
        let mut reached = 0;
        for link in &state.links {
            let body = own(&link.caller).map_or_else(|| Arc::clone(&shared), Arc::from);
            match link.queue.push(body) {
                Push::Queued => reached += 1,
                Push::DroppedOldest => {
                    reached += 1;
                    self.dropped.fetch_add(1, Relaxed);
                }
                Push::Closed => {}
            }
        }
        if self.options.latch {
            state.latched = Some(shared);
        }
        reached
    }

    pub(crate) fn links(&self) -> Vec<Arc<SubscriberLink>> {
        lock(&self.state).links.clone()
    }

    pub(crate) fn lags(&self) -> Vec<SubscriberLag> {
        let state = lock(&self.state);
        let lags = state.links.iter().map(|link| SubscriberLag {
            subscriber: link.caller.clone(),
            waiting: link.queue.len(),
        });
        lags.collect()
    }

    pub(crate) fn subscribers(&self) -> usize {
        lock(&self.state).links.len()
    }

    /// Number of messages dropped since the topic was advertised, summed over all subscribers.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Relaxed)
    }

    /// Closes the publication: messages in the queues are still sent, but no further ones are
    /// queued.
    pub(crate) fn close(&self) {
        let mut state = lock(&self.state);
        state.closed = true;
        for link in &state.links {
            link.queue.close();
        }
    }

    /// Sends the topic's messages to one subscriber, whose connection header has already been read.
    /// Returns when either side closes the connection.
    pub(crate) async fn serve(
        self: Arc<Self>,
        mut stream: TcpStream,
        header: &Header,
        node: &str,
    ) -> Result<(), HeaderError> {
        let what = format!("topic [{}]", self.name);
        let (name, md5) = (self.message_type.name, self.message_type.md5);
        if let Some(mismatch) = type_mismatch(header, &what, name, md5) {
            tracing::warn!(subscriber = header.get("callerid"), "refused: {mismatch}");
            return refuse(stream, &mismatch).await;
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
        attached.link.send_messages(stream).await?;
        Ok(())
    }

    /// Adds a link to a new subscriber. The link's queue starts with the latched message, if any,
    /// and then receives every message published later.
    fn attach(self: &Arc<Self>, caller: String, peer: SocketAddr) -> AttachedLink {
        let link = Arc::new(SubscriberLink {
            id: self.next_id.fetch_add(1, Relaxed),
            caller,
            peer,
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            queue: DropOldestQueue::new(self.options.queue),
        });
        let mut state = lock(&self.state);
        if let Some(latched) = &state.latched {
            link.queue.push(Arc::clone(latched));
        }
        if state.closed {
            link.queue.close();
        }
        state.links.push(Arc::clone(&link));
        AttachedLink { publication: Arc::clone(self), link }
    }
}

/// Guard of a subscriber link. When the connection ends, the guard is dropped and removes the link
/// from the publication.
struct AttachedLink {
    publication: Arc<Publication>,
    link: Arc<SubscriberLink>,
}

impl Drop for AttachedLink {
    fn drop(&mut self) {
        lock(&self.publication.state).links.retain(|link| !Arc::ptr_eq(link, &self.link));
    }
}

impl SubscriberLink {
    async fn send_messages(&self, mut stream: TcpStream) -> std::io::Result<()> {
        // A subscriber sends nothing after its header, so this read only detects that the
        // subscriber has closed the connection.
        let mut ignored = [0; 64];
        loop {
            tokio::select! {
                message = self.queue.pop() => {
                    let Some(message) = message else { return stream.shutdown().await };
                    write_message(&mut stream, &message).await?;
                    self.messages.fetch_add(1, Relaxed);
                    self.bytes.fetch_add(u64::try_from(message.len()).unwrap_or(u64::MAX), Relaxed);
                }
                count = stream.read(&mut ignored) => if count? == 0 { return Ok(()) },
            }
        }
    }
}
