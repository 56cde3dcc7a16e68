//! Peers that vanish without a word, as far as one machine can show it: what the system's table
//! of connections says.

use ros1::PublisherOptions;

use crate::{
    local::{master, node, tcpros, until},
    types::{SET_BOOL, STRING},
};

/// Of the established connections from or to `port`: all of them, and those whose keepalive
/// timer runs.
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
async fn both_ends_of_every_topic_and_service_connection_are_probed() {
    let master = master().await;
    let talker = node("talker", &master).await;
    let listener = node("listener", &master).await;
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
    until("the subscriber", async || publisher.subscribers() == 1).await;
    let address = tcpros(&talker, "/chat").await;
    let (_, port) = address.rsplit_once(':').unwrap();
    let port = port.parse().unwrap();
    // Topic and service, each with two ends on this machine.
    until("the timers", async || connections(port) == (4, 4)).await;
}
