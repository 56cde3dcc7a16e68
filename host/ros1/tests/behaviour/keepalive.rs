//! TCP keepalive, which detects peers whose machine has vanished. A peer on the same machine cannot
//! vanish, so the test checks in Linux's connection table that keepalive is enabled.

use ros1::PublisherOptions;

use crate::{
    local::{start_master, start_node, tcpros_address, wait_until},
    types::{SET_BOOL, STRING},
};

/// Returns the number of established sockets with `port` at either end, and how many of them have a
/// running keepalive timer.
fn connections(port: u16) -> (usize, usize) {
    let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
    let port = format!(":{port:04X}");
    let mut counts = (0, 0);
    for line in table.lines().skip(1) {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (local, remote, state, timer) = (fields[1], fields[2], fields[3], fields[5]);
        if state == "01" && (local.ends_with(&port) || remote.ends_with(&port)) {
            counts.0 += 1;
            counts.1 += usize::from(timer.starts_with("02:"));
        }
    }
    counts
}

#[tokio::test]
async fn both_ends_of_topic_and_service_connections_use_keepalive() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let listener = start_node("listener", &master).await;
    let options = PublisherOptions {
        queue: 4,
        latch: false,
    };
    let publisher = talker.advertise("/chat", &STRING, options).await.unwrap();
    let _service = talker
        .serve("/serve", &SET_BOOL, |_| Ok(vec![]))
        .await
        .unwrap();
    let _subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    let _client = listener.connect("/serve", &SET_BOOL).await.unwrap();
    wait_until("the subscriber to connect", async || {
        publisher.subscribers() == 1
    })
    .await;
    let address = tcpros_address(&talker, "/chat").await;
    let (_, port) = address.rsplit_once(':').unwrap();
    let port = port.parse().unwrap();
    // There is one topic connection and one service connection. Both ends of each are on this
    // machine, so the table lists four sockets.
    wait_until("the keepalive timers", async || connections(port) == (4, 4)).await;
}
