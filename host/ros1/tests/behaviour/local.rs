//! Support code: starts masters and nodes on this machine and queries them.

use std::{
    net::SocketAddr,
    time::{Duration, Instant},
};

use ros1::{
    Master, Node, NodeOptions,
    tcpros::Header,
    xmlrpc::{Value, call_ros},
};
use tokio::{
    io::AsyncReadExt as _,
    net::TcpStream,
    time::{sleep, timeout},
};

/// Time limit of each wait: far longer than any operation takes, even on a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(20);

pub(crate) async fn start_master() -> Master {
    Master::start(SocketAddr::from(([127, 0, 0, 1], 0)))
        .await
        .unwrap()
}

pub(crate) async fn start_node(name: &str, master: &Master) -> Node {
    Node::start(NodeOptions::new(name, master.uri()))
        .await
        .unwrap()
}

pub(crate) async fn wait_until(what: &str, mut done: impl AsyncFnMut() -> bool) {
    let started = Instant::now();
    while !done().await {
        assert!(started.elapsed() < TIMEOUT, "timed out waiting for {what}");
        sleep(Duration::from_millis(10)).await;
    }
}

/// Asks `node` for the TCPROS address of `topic` and returns it as `HOST:PORT`.
pub(crate) async fn tcpros_address(node: &Node, topic: &str) -> String {
    let protocols = Value::from([Value::from(["TCPROS"])]);
    let arguments = [Value::from("/test"), topic.into(), protocols];
    let offer = call_ros(node.uri(), "requestTopic", &arguments)
        .await
        .unwrap();
    let [_, host, port] = offer.as_array().unwrap() else {
        panic!("{offer:?}")
    };
    format!("{}:{}", host.as_str().unwrap(), port.as_int().unwrap())
}

/// Returns a TCP port on which nothing listens.
pub(crate) fn free_port() -> u16 {
    std::net::TcpListener::bind(("127.0.0.1", 0))
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

/// Reports that a test did not run. Writes to stderr directly, because the test harness captures
/// `eprintln!`.
pub(crate) fn report_skipped(test: &str, why: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "SKIPPED: {test}: {why}");
}

/// Returns the socket address on which a master listens.
pub(crate) fn socket_address(master: &Master) -> SocketAddr {
    master
        .uri()
        .trim_start_matches("http://")
        .trim_end_matches('/')
        .parse()
        .unwrap()
}

/// Returns whether the master has this node's URI under the node's name.
pub(crate) async fn is_registered(master: &Master, node: &Node) -> bool {
    let arguments = [Value::from("/test"), node.name().into()];
    let answer = call_ros(master.uri(), "lookupNode", &arguments).await;
    answer.is_ok_and(|uri| uri.as_str() == Some(node.uri()))
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
    timeout(Duration::from_secs(15), stream.read_to_end(&mut rest))
        .await
        .is_ok()
}
