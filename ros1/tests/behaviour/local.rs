//! A master and nodes of ours on this machine.

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

/// Longer than anything takes on a busy machine.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

pub(crate) async fn master() -> Master {
    Master::start(SocketAddr::from(([127, 0, 0, 1], 0)))
        .await
        .unwrap()
}

pub(crate) async fn node(name: &str, master: &Master) -> Node {
    Node::start(NodeOptions::new(name, master.uri()))
        .await
        .unwrap()
}

pub(crate) async fn until(what: &str, mut done: impl AsyncFnMut() -> bool) {
    let started = Instant::now();
    while !done().await {
        assert!(started.elapsed() < PATIENCE, "{what} did not come");
        sleep(Duration::from_millis(10)).await;
    }
}

/// Where `node` serves `topic`.
pub(crate) async fn tcpros(node: &Node, topic: &str) -> String {
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

/// A port that nobody listens on.
pub(crate) fn free_port() -> u16 {
    std::net::TcpListener::bind(("127.0.0.1", 0))
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

/// Says loudly that a test did not run: the harness would swallow eprintln!.
pub(crate) fn skipped(test: &str, why: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "SKIPPED: {test}: {why}");
}

/// Where a master listens.
pub(crate) fn address(master: &Master) -> SocketAddr {
    master
        .uri()
        .trim_start_matches("http://")
        .trim_end_matches('/')
        .parse()
        .unwrap()
}

/// The master knows this very node by its name.
pub(crate) async fn knows(master: &Master, node: &Node) -> bool {
    let arguments = [Value::from("/test"), node.name().into()];
    let answer = call_ros(master.uri(), "lookupNode", &arguments).await;
    answer.is_ok_and(|uri| uri.as_str() == Some(node.uri()))
}

/// Reads what a peer answers first.
pub(crate) async fn read_header(stream: &mut TcpStream) -> Header {
    let length = stream.read_u32_le().await.unwrap();
    let mut bytes = vec![0; length as usize];
    stream.read_exact(&mut bytes).await.unwrap();
    Header::decode(&bytes).unwrap()
}

/// The peer closes without a word, within the time limit of a handshake and some.
pub(crate) async fn is_closed(stream: &mut TcpStream) -> bool {
    let mut rest = Vec::new();
    timeout(Duration::from_secs(15), stream.read_to_end(&mut rest))
        .await
        .is_ok()
}
