//! Clients that misbehave towards the bridge's ROS node, which must not affect other subscribers.

use std::time::Duration;

use neuro_ros::ros1::tcpros::Header;
use neuro_ros::ros1::xmlrpc::{Value, call_ros};
use neuro_ros::{NeuroFrame, RosMessage};
use rustix::process::Signal;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::board::assert_has;
use crate::graph::{Graph, ended, frame, until};
use crate::process::TIMEOUT;

/// Returns the URI of the bridge's XML-RPC server; `None` while the ROS master does not know it.
async fn bridge_uri(master: &str) -> Option<String> {
    let arguments = ["/test", "/acquisition"].map(|text| Value::String(text.to_owned()));
    let answer = call_ros(master, "lookupNode", &arguments).await.ok()?;
    answer.as_str().map(str::to_owned)
}

/// Returns the address HOST:PORT at which the bridge serves `/encoded` to subscribers.
async fn tcpros(bridge: &str) -> String {
    let protocol = Value::Array(vec![Value::String("TCPROS".into())]);
    let arguments = [
        Value::String("/test".into()),
        Value::String("/encoded".into()),
        Value::Array(vec![protocol]),
    ];
    let answer = call_ros(bridge, "requestTopic", &arguments).await.unwrap();
    let [_, host, port] = answer.as_array().unwrap() else {
        panic!("{answer:?}")
    };
    format!("{}:{}", host.as_str().unwrap(), port.as_int().unwrap())
}

fn subscription(md5: &str) -> Vec<u8> {
    let header = Header::new()
        .with("callerid", "/abuser")
        .with("md5sum", md5)
        .with("topic", "/encoded")
        .with("type", "rosneuro_msgs/NeuroFrame");
    header.encode().unwrap()
}

/// Connects to `address`, sends `bytes` and returns the open connection.
async fn send(address: &str, bytes: &[u8]) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(bytes).await.unwrap();
    stream
}

#[tokio::test]
async fn no_abuse_costs_a_subscriber_a_frame() {
    let graph = Graph::new().await;
    let bridge = graph.bridge();
    let mut encoded = graph.subscribe("/encoded").await;
    let mut next = frame(&mut encoded).await.neuroheader.seq;
    let mut uri = None;
    until("the node", async || {
        uri = bridge_uri(graph.master.uri()).await;
        uri.is_some()
    })
    .await;
    let uri = uri.unwrap();
    let topic = tcpros(&uri).await;
    let api = uri.trim_start_matches("http://").trim_end_matches('/');

    let mut held = Vec::new();
    // Clients that connect to the topic's port or the XML-RPC port and send nothing.
    for _ in 0..20 {
        held.push(send(&topic, b"").await);
        held.push(send(api, b"").await);
    }
    // A subscriber that never reads its messages.
    held.push(send(&topic, &subscription(NeuroFrame::TYPE.md5)).await);
    // A header that claims a length of 4 GiB, an incomplete HTTP request, and invalid XML.
    held.push(send(&topic, &u32::MAX.to_le_bytes()).await);
    held.push(send(api, b"POST / HTTP/1.1\r\nContent-Length: 100\r\n\r\n<").await);
    held.push(send(api, b"POST / HTTP/1.1\r\nContent-Length: 5\r\n\r\n<<>>!").await);
    // Subscribers that reset the connection right after their header.
    for _ in 0..10 {
        let stream = send(&topic, &subscription(NeuroFrame::TYPE.md5)).await;
        stream.set_zero_linger().unwrap();
    }
    // A subscriber with another MD5 sum of the message definition receives an error.
    let mut wrong = send(&topic, &subscription("00000000000000000000000000000000")).await;
    let mut answer = Vec::new();
    let read = timeout(TIMEOUT, wrong.read_to_end(&mut answer)).await;
    read.unwrap().unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    assert_has(&answer, ["error=", "md5"]);

    for _ in 0..100 {
        let frame = frame(&mut encoded).await;
        next += 1;
        assert_eq!(frame.neuroheader.seq, next);
        assert_eq!(frame.tri.data[0] & 0x8000, 0);
    }
    assert_eq!(encoded.dropped(), 0);
    drop(held);
    tokio::time::sleep(Duration::from_millis(50)).await;
    bridge.signal(Signal::TERM);
    let log = ended(bridge).await;
    assert!(log.contains(" lost 0 "), "{log}");
}
