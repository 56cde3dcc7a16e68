//! A master and nodes of ours on this machine, and a publisher that misbehaves on command.

use std::{
    net::SocketAddr,
    time::{Duration, Instant},
};

use ros1::{
    Master, MessageType, Node, NodeOptions,
    tcpros::Header,
    xmlrpc::{Value, call_ros, encode_response},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
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

/// Answers requestTopic with its own port, where the test does as it likes.
pub(crate) struct FakePublisher {
    listener: TcpListener,
}

impl FakePublisher {
    /// Registers as the publisher of `topic`.
    pub(crate) async fn start(topic: &str, master: &Master) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let api = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let uri = format!("http://{}/", api.local_addr().unwrap());
        let port = Value::Int(listener.local_addr().unwrap().port().into());
        let offer = Value::Array(vec!["TCPROS".into(), "127.0.0.1".into(), port]);
        let triple = Value::Array(vec![1.into(), "".into(), offer]);
        let body = encode_response(&Ok(triple));
        tokio::spawn(async move {
            loop {
                let (mut stream, _) = api.accept().await.unwrap();
                // The request is small and comes in one piece.
                let _ = stream.read(&mut [0; 4096]).await;
                let head = "HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n";
                let _ = stream.write_all(format!("{head}{body}").as_bytes()).await;
            }
        });
        let arguments = ["/fake", topic, "std_msgs/String", &uri].map(Value::from);
        call_ros(master.uri(), "registerPublisher", &arguments)
            .await
            .unwrap();
        Self { listener }
    }

    /// The subscriber's next connection; its header is read.
    pub(crate) async fn accept(&self) -> TcpStream {
        let (mut stream, _) = timeout(PATIENCE, self.listener.accept())
            .await
            .unwrap()
            .unwrap();
        let length = stream.read_u32_le().await.unwrap();
        let mut header = vec![0; length as usize];
        stream.read_exact(&mut header).await.unwrap();
        stream
    }

    /// As [`FakePublisher::accept`], with a proper answer.
    pub(crate) async fn accept_and_greet(&self, message_type: &MessageType) -> TcpStream {
        let mut stream = self.accept().await;
        let header = Header::new()
            .with("callerid", "/fake")
            .with("md5sum", message_type.md5)
            .with("type", message_type.name);
        stream.write_all(&header.encode().unwrap()).await.unwrap();
        stream
    }
}
