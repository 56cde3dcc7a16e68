//! A fake publisher: the test writes each byte that a subscriber receives.

use ros1::{
    Master, MessageType,
    tcpros::Header,
    xmlrpc::{Value, call_ros, encode_response},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    time::timeout,
};

use crate::local::TIMEOUT;

/// A publisher that refers subscribers to a listener of the test, which accepts their connections.
pub(crate) struct FakePublisher {
    listener: TcpListener,
}

impl FakePublisher {
    /// Registers as a publisher of `topic` and answers requestTopic in the background.
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
                // A request of at most 4096 bytes on loopback arrives in one read.
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

    /// Accepts the next connection of the subscriber and reads its header.
    pub(crate) async fn accept(&self) -> TcpStream {
        let (mut stream, _) = timeout(TIMEOUT, self.listener.accept())
            .await
            .unwrap()
            .unwrap();
        let length = stream.read_u32_le().await.unwrap();
        let mut header = vec![0; length as usize];
        stream.read_exact(&mut header).await.unwrap();
        stream
    }

    /// Accepts the next connection, reads the subscriber's header and answers with a valid header
    /// of type `message_type`.
    pub(crate) async fn accept_and_answer(&self, message_type: &MessageType) -> TcpStream {
        let mut stream = self.accept().await;
        let header = Header::new()
            .with("callerid", "/fake")
            .with("md5sum", message_type.md5)
            .with("type", message_type.name);
        stream.write_all(&header.encode().unwrap()).await.unwrap();
        stream
    }
}
