//! Support code: starts masters and nodes on this machine and queries them.

use std::{
    net::SocketAddr,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
    time::{Duration, Instant},
};

use ros1::{
    Master, MasterStatus, MessageType, Node, NodeOptions, Publisher, PublisherOptions, Service,
    ServiceType, Subscriber,
    tcpros::Header,
    xmlrpc::{Value, call_ros},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    time::{sleep, timeout},
};

/// Time limit of each wait: far longer than any operation takes, even on a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(30);

pub(crate) const QUEUE: PublisherOptions = PublisherOptions { queue: 4096, latch: false };
pub(crate) const LATCH: PublisherOptions = PublisherOptions { queue: 4, latch: true };

/// A message with one string. `rosmsg md5 std_msgs/String` prints its MD5 sum.
pub(crate) static STRING: MessageType = MessageType {
    name: "std_msgs/String",
    md5: "992ce8a1687cec8c8bd883ec73ca41d1",
    definition: "string data\n",
};

/// A service that sets a boolean. `rossrv md5 std_srvs/SetBool` prints its MD5 sum.
pub(crate) static SET_BOOL: ServiceType = ServiceType {
    name: "std_srvs/SetBool",
    md5: "09fb03525b03e7ea1fd3992bafd87e16",
    definition: "bool data\n---\nbool success\nstring message\n",
};

/// Encodes the body of a std_msgs/String.
pub(crate) fn string(text: &str) -> Vec<u8> {
    let mut body = u32::try_from(text.len()).unwrap().to_le_bytes().to_vec();
    body.extend_from_slice(text.as_bytes());
    body
}

/// A master, and a node that publishes `/chat`.
pub(crate) struct Talker {
    pub(crate) master: Master,
    pub(crate) node: Node,
    pub(crate) publisher: Publisher,
}

impl Talker {
    pub(crate) async fn start(options: PublisherOptions) -> Self {
        let master = start_master().await;
        let node = start_node("talker", &master).await;
        let publisher = node.advertise("/chat", &STRING, options).await.unwrap();
        Self { master, node, publisher }
    }

    /// Starts a talker that has published one latched message, `hello`.
    pub(crate) async fn latched() -> Self {
        let talker = Self::start(LATCH).await;
        talker.publisher.publish(&string("hello"));
        talker
    }

    /// Starts another node that subscribes to `/chat`.
    pub(crate) async fn listener(&self, queue: usize) -> (Node, Subscriber) {
        let node = start_node("listener", &self.master).await;
        let subscriber = node.subscribe("/chat", &STRING, queue).await.unwrap();
        (node, subscriber)
    }

    /// Asks the node for the TCPROS address of `/chat` and returns it as `HOST:PORT`.
    pub(crate) async fn address(&self) -> String {
        let protocols = Value::from([Value::from(["TCPROS"])]);
        let arguments = [Value::from("/test"), "/chat".into(), protocols];
        let offer = call_ros(self.node.uri(), "requestTopic", &arguments).await;
        let offer = offer.unwrap();
        let [_, host, port] = offer.as_array().unwrap() else { panic!("{offer:?}") };
        format!("{}:{}", host.as_str().unwrap(), port.as_int().unwrap())
    }
}

pub(crate) async fn start_master() -> Master {
    master_at(SocketAddr::from(([127, 0, 0, 1], 0))).await
}

pub(crate) async fn master_at(address: SocketAddr) -> Master {
    Master::start(address).await.unwrap()
}

pub(crate) async fn start_node(name: &str, master: &Master) -> Node {
    node_at(name, master.uri()).await
}

/// Starts a node whose master has the URI `master`.
pub(crate) async fn node_at(name: &str, master: &str) -> Node {
    Node::start(NodeOptions::new(name, master)).await.unwrap()
}

/// Provides a service that answers every call with `answer`.
pub(crate) async fn serve(node: &Node, name: &str, answer: &'static [u8]) -> Service {
    let handler = |_: &str, _: &[u8]| Ok(answer.to_vec());
    node.serve(name, &SET_BOOL, handler).await.unwrap()
}

pub(crate) async fn wait_until(what: &str, mut done: impl AsyncFnMut() -> bool) {
    let started = Instant::now();
    while !done().await {
        assert!(started.elapsed() < TIMEOUT, "timed out waiting for {what}");
        sleep(Duration::from_millis(10)).await;
    }
}

/// Waits until `publisher` has exactly this number of subscribers.
pub(crate) async fn wait_for_subscribers(publisher: &Publisher, subscribers: usize) {
    wait_until("the subscribers", async || publisher.subscribers() == subscribers).await;
}

/// Waits until the node knows that its master answers or, if `is_online` is false, does not answer.
pub(crate) async fn wait_for_master(node: &Node, is_online: bool) {
    let mut status = node.master_status();
    let is_wanted = |status: &MasterStatus| (*status == MasterStatus::Online) == is_online;
    let changed = timeout(TIMEOUT, status.wait_for(is_wanted)).await;
    changed.unwrap().unwrap();
}

/// Waits until the master has the registrations of these nodes. A node must register again within
/// 2 s; the other 2 s are a margin for a busy machine.
pub(crate) async fn wait_for_registration(master: &str, nodes: &[&Node]) {
    let back = Instant::now();
    for node in nodes {
        wait_until("the registration", async || is_registered(master, node).await).await;
    }
    println!("registered again after {:?}", back.elapsed());
    assert!(back.elapsed() < Duration::from_secs(4));
}

/// Waits for the next message and returns its body; `None` if the node has shut down.
pub(crate) async fn receive(subscriber: &mut Subscriber) -> Option<Vec<u8>> {
    timeout(TIMEOUT, subscriber.recv()).await.unwrap()
}

/// Expects that the next message is this std_msgs/String.
pub(crate) async fn expect_text(subscriber: &mut Subscriber, text: &str) {
    assert_eq!(receive(subscriber).await, Some(string(text)));
}

/// Returns a TCP port on which nothing listens. It is below the ports that the operating system
/// chooses (32,768 and more on Linux), so that no socket of another test takes it.
pub(crate) fn free_port() -> u16 {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    loop {
        let next = NEXT.fetch_add(1, Relaxed);
        let port = 20_000 + (std::process::id() % 500 * 20 + next) % 10_000;
        let port = u16::try_from(port).unwrap();
        if std::net::TcpListener::bind(("127.0.0.1", port)).is_ok() {
            return port;
        }
    }
}

/// Returns the URI of a master on `port` of the loopback address.
pub(crate) fn uri(port: u16) -> String {
    format!("http://127.0.0.1:{port}/")
}

/// Returns the part `HOST:PORT` of a URI.
pub(crate) fn host_and_port(uri: &str) -> &str {
    uri.trim_start_matches("http://").trim_end_matches('/')
}

/// Reports that a test did not run. Writes to stderr directly, because the test harness captures
/// `eprintln!`.
pub(crate) fn report_skipped(test: &str, why: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "SKIPPED: {test}: {why}");
}

pub(crate) fn socket_address(master: &Master) -> SocketAddr {
    host_and_port(master.uri()).parse().unwrap()
}

/// Returns whether the master has this node's URI under the node's name.
pub(crate) async fn is_registered(master: &str, node: &Node) -> bool {
    let arguments = [Value::from("/test"), node.name().into()];
    let answer = call_ros(master, "lookupNode", &arguments).await;
    answer.is_ok_and(|uri| uri.as_str() == Some(node.uri()))
}

pub(crate) async fn answers(uri: &str) -> bool {
    call_ros(uri, "getPid", &["/test".into()]).await.is_ok()
}

/// Opens a connection and writes `bytes`.
pub(crate) async fn open(address: &str, bytes: &[u8]) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(bytes).await.unwrap();
    stream
}

/// Reads the connection header that a peer sends.
pub(crate) async fn read_header(stream: &mut TcpStream) -> Header {
    let length = stream.read_u32_le().await.unwrap();
    let mut bytes = vec![0; length as usize];
    stream.read_exact(&mut bytes).await.unwrap();
    Header::decode(&bytes).unwrap()
}

/// Returns whether the peer closes the connection within 15 s, three times the handshake timeout.
pub(crate) async fn is_closed(stream: &mut TcpStream) -> bool {
    let mut rest = Vec::new();
    timeout(Duration::from_secs(15), stream.read_to_end(&mut rest)).await.is_ok()
}
