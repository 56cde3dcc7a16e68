//! Fake peers: a publisher whose bytes the test writes, and a master whose answers the test delays.

use std::sync::Arc;

use ros1::{
    Master,
    tcpros::Header,
    xmlrpc::{Value, call_ros, encode_response},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    sync::Notify,
    time::timeout,
};

use crate::local::{STRING, TIMEOUT, read_header, socket_address, uri};

/// Accepts a connection, reads an XML-RPC request and answers it with the array `answer`. Returns
/// the text of the request.
pub(crate) async fn answer_one(listener: &TcpListener, answer: [Value; 3]) -> String {
    let (mut stream, _) = listener.accept().await.unwrap();
    let request = read_request(&mut stream).await;
    let head = "HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n";
    let body = encode_response(&Ok(answer.into()));
    let _ = stream.write_all(format!("{head}{body}").as_bytes()).await;
    request
}

/// Reads an HTTP request; its head states the length of its body.
async fn read_request(stream: &mut TcpStream) -> String {
    let mut request = Vec::new();
    loop {
        let count = stream.read_buf(&mut request).await.unwrap_or(0);
        let text = String::from_utf8_lossy(&request);
        let head_end = request.windows(4).position(|part| part == b"\r\n\r\n");
        let mut lines = text.lines().map(str::to_ascii_lowercase);
        let length =
            lines.find_map(|line| line.strip_prefix("content-length:")?.trim().parse().ok());
        let complete = head_end.map(|end| end + 4 + length.unwrap_or(0));
        if count == 0 || complete.is_some_and(|end: usize| request.len() >= end) {
            return text.into_owned();
        }
    }
}

/// A publisher whose subscribers connect to a TCP listener of the test.
pub(crate) struct FakePublisher {
    listener: TcpListener,
}

impl FakePublisher {
    /// Registers as a publisher of `topic` and answers requestTopic in the background.
    pub(crate) async fn start(topic: &str, master: &Master) -> Self {
        let api = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        register(topic, &uri(api.local_addr().unwrap().port()), master).await;
        Self::answer(api, "127.0.0.1").await
    }

    /// Answers requestTopic on `api` in the background, with `host` as the host to connect to.
    pub(crate) async fn answer(api: TcpListener, host: &'static str) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let port = Value::Int(listener.local_addr().unwrap().port().into());
        tokio::spawn(async move {
            loop {
                let offer = Value::Array(vec!["TCPROS".into(), host.into(), port.clone()]);
                answer_one(&api, [1.into(), "".into(), offer]).await;
            }
        });
        Self { listener }
    }

    /// Accepts the next connection of the subscriber and reads its header.
    pub(crate) async fn accept(&self) -> TcpStream {
        let accepted = timeout(TIMEOUT, self.listener.accept()).await;
        let (mut stream, _) = accepted.unwrap().unwrap();
        read_header(&mut stream).await;
        stream
    }

    /// Accepts the next connection, reads the subscriber's header and answers with a valid header.
    pub(crate) async fn accept_and_answer(&self) -> TcpStream {
        let mut stream = self.accept().await;
        let header = Header::new()
            .with("callerid", "/fake")
            .with("md5sum", STRING.md5)
            .with("type", STRING.name);
        stream.write_all(&header.encode().unwrap()).await.unwrap();
        stream
    }
}

/// Registers a publisher of `topic` with the XML-RPC URI `uri`, where no server needs to run.
pub(crate) async fn register(topic: &str, uri: &str, master: &Master) {
    let arguments = ["/fake", topic, "std_msgs/String", uri].map(Value::from);
    let registered = call_ros(master.uri(), "registerPublisher", &arguments).await;
    registered.unwrap();
}

/// A proxy that forwards every call to a master and holds back the first answer to one method
/// until [`DelayingProxy::release`] is called.
pub(crate) struct DelayingProxy {
    held: Arc<Notify>,
    release: Arc<Notify>,
}

impl DelayingProxy {
    pub(crate) fn start(listener: TcpListener, master: &Master, method: &'static str) -> Self {
        let (held, release) = (Arc::new(Notify::new()), Arc::new(Notify::new()));
        let ours = Self { held: Arc::clone(&held), release: Arc::clone(&release) };
        let master = socket_address(master);
        tokio::spawn(async move {
            let mut first = true;
            loop {
                let (mut stream, _) = listener.accept().await.unwrap();
                let request = read_request(&mut stream).await;
                let mut upstream = TcpStream::connect(master).await.unwrap();
                upstream.write_all(request.as_bytes()).await.unwrap();
                let mut answer = Vec::new();
                upstream.read_to_end(&mut answer).await.unwrap();
                if request.contains(method) && std::mem::take(&mut first) {
                    held.notify_one();
                    release.notified().await;
                }
                // Ignore errors: the caller can have timed out and closed the connection.
                let _ = stream.write_all(&answer).await;
            }
        });
        ours
    }

    /// Waits until the master has answered and the answer is held back.
    pub(crate) async fn wait_until_held(&self) {
        timeout(TIMEOUT, self.held.notified()).await.unwrap();
    }

    pub(crate) fn release(&self) {
        self.release.notify_one();
    }
}
