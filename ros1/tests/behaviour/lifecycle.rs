//! Nodes and masters that come, go, and take each other's names.

use std::time::Duration;

use ros1::{
    DEFAULT_MASTER_URI, Master, Node, NodeError, NodeOptions, PublisherOptions,
    xmlrpc::{Value, call_ros},
};
use tokio::time::timeout;

use crate::{
    local::{PATIENCE, address, knows, master, node, skipped, until},
    types::{SET_BOOL, STRING, string},
};

const QUEUE: PublisherOptions = PublisherOptions {
    queue: 4096,
    latch: false,
};
const LATCH: PublisherOptions = PublisherOptions {
    queue: 4,
    latch: true,
};

async fn state(master: &Master) -> Value {
    call_ros(master.uri(), "getSystemState", &["/test".into()])
        .await
        .unwrap()
}

fn empty() -> Value {
    Value::Array(vec![Value::Array(vec![]); 3])
}

#[tokio::test]
async fn a_namesake_takes_the_name_and_the_old_node_is_asked_to_end() {
    let master = master().await;
    let old = node("same", &master).await;
    let old_topic = old.advertise("/chat", &STRING, LATCH).await.unwrap();
    old_topic.publish(&string("old"));
    let new = node("same", &master).await;
    let new_topic = new.advertise("/chat", &STRING, LATCH).await.unwrap();
    new_topic.publish(&string("new"));
    timeout(PATIENCE, old.shutdown_requested()).await.unwrap();
    // The old one does not fight for the name.
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert!(knows(&master, &new).await);
    old.shutdown().await;
    assert!(knows(&master, &new).await);
    let listener = node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    assert_eq!(
        timeout(PATIENCE, subscriber.recv()).await.unwrap(),
        Some(string("new"))
    );
    assert_eq!(subscriber.publishers(), 1);
    assert!(
        timeout(Duration::from_millis(200), new.shutdown_requested())
            .await
            .is_err()
    );
}

#[tokio::test]
async fn shutdown_unregisters_everything_sends_what_is_queued_and_frees_the_ports() {
    let master = master().await;
    let talker = node("talker", &master).await;
    let listener = node("listener", &master).await;
    let publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let _service = talker
        .serve("/serve", &SET_BOOL, |_| Ok(vec![]))
        .await
        .unwrap();
    let mut subscriber = listener.subscribe("/chat", &STRING, 4096).await.unwrap();
    until("the subscriber", async || publisher.subscribers() == 1).await;
    for number in 0..1000 {
        publisher.publish(&string(&number.to_string()));
    }
    let uri = talker.uri().to_owned();
    talker.shutdown().await;
    talker.shutdown().await;
    assert_eq!(publisher.publish(&string("late")), 0);
    let refused = talker.advertise("/more", &STRING, QUEUE).await;
    assert!(matches!(refused, Err(NodeError::ShutDown)));
    for number in 0..1000 {
        let message = timeout(PATIENCE, subscriber.recv()).await.unwrap();
        assert_eq!(message, Some(string(&number.to_string())));
    }
    assert!(call_ros(&uri, "getPid", &["/test".into()]).await.is_err());
    listener.shutdown().await;
    assert_eq!(subscriber.recv().await, None);
    assert_eq!(state(&master).await, empty());
    let address = address(&master);
    master.shutdown().await;
    drop(std::net::TcpListener::bind(address).unwrap());
}

#[tokio::test]
async fn what_is_dropped_is_unregistered_and_can_be_had_again() {
    let master = master().await;
    let ours = node("ours", &master).await;
    for round in 0..3 {
        let publisher = ours.advertise("/chat", &STRING, LATCH).await.unwrap();
        let twice = ours.advertise("/chat", &STRING, LATCH).await;
        assert!(matches!(twice, Err(NodeError::Taken(_))));
        let mut subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
        let service = ours
            .serve("/serve", &SET_BOOL, |_| Ok(vec![]))
            .await
            .unwrap();
        publisher.publish(&string(&format!("{round}")));
        let message = timeout(PATIENCE, subscriber.recv()).await.unwrap();
        assert_eq!(message, Some(string(&format!("{round}"))));
        drop((publisher, subscriber, service));
    }
    until("the farewell", async || state(&master).await == empty()).await;
}

#[tokio::test]
async fn subscribers_that_come_and_go_disturb_nobody() {
    let master = master().await;
    let talker = node("talker", &master).await;
    let listener = node("listener", &master).await;
    let publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let mut steady = listener.subscribe("/chat", &STRING, 4096).await.unwrap();
    until("the subscriber", async || publisher.subscribers() == 1).await;
    let mut expected = 0;
    for round in 0..10 {
        let guest = node(&format!("guest{round}"), &master).await;
        let mut visiting = guest.subscribe("/chat", &STRING, 4).await.unwrap();
        until("the guest", async || publisher.subscribers() == 2).await;
        for _ in 0..10 {
            publisher.publish(&string(&expected.to_string()));
            expected += 1;
        }
        assert!(timeout(PATIENCE, visiting.recv()).await.unwrap().is_some());
        guest.shutdown().await;
        until("the guest's end", async || publisher.subscribers() == 1).await;
    }
    for number in 0..expected {
        let message = timeout(PATIENCE, steady.recv()).await.unwrap();
        assert_eq!(message, Some(string(&number.to_string())));
    }
    assert_eq!((publisher.dropped(), steady.dropped()), (0, 0));
}

#[tokio::test]
async fn everything_works_over_ipv6() {
    let Ok(master) = Master::start("[::1]:0".parse().unwrap()).await else {
        skipped("everything_works_over_ipv6", "this machine has no IPv6");
        return;
    };
    let talker = node("talker", &master).await;
    assert!(
        talker.uri().starts_with("http://[::1]:"),
        "{}",
        talker.uri()
    );
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let _service = talker
        .serve("/serve", &SET_BOOL, |_| Ok(vec![7]))
        .await
        .unwrap();
    let listener = node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    assert_eq!(
        timeout(PATIENCE, subscriber.recv()).await.unwrap(),
        Some(string("hello"))
    );
    assert_eq!(listener.call("/serve", &SET_BOOL, &[0]).await.unwrap(), [7]);
}

#[tokio::test]
async fn a_master_asked_to_end_says_so_and_refuses_bad_addresses() {
    let first = master().await;
    let second = Master::start(address(&first)).await;
    assert_eq!(second.unwrap_err().kind(), std::io::ErrorKind::AddrInUse);
    let arguments = [Value::from("/test"), "enough".into()];
    call_ros(first.uri(), "shutdown", &arguments).await.unwrap();
    timeout(PATIENCE, first.shutdown_requested()).await.unwrap();
    first.shutdown().await;
}

#[tokio::test]
async fn what_cannot_work_is_told_at_once() {
    let start = async |name: &str, uri: &str| Node::start(NodeOptions::new(name, uri)).await;
    assert!(matches!(
        start("no name", DEFAULT_MASTER_URI).await,
        Err(NodeError::Name(_))
    ));
    assert!(matches!(
        start("ours", "localhost:11311").await,
        Err(NodeError::MasterUri(_))
    ));
    let mut elsewhere = NodeOptions::new("ours", DEFAULT_MASTER_URI);
    elsewhere.remaps = vec![("bad name".to_owned(), "x".to_owned())];
    assert!(matches!(
        Node::start(elsewhere).await,
        Err(NodeError::Name(_))
    ));
    let master = master().await;
    let ours = node("ours", &master).await;
    let bad = ours.advertise("a b", &STRING, QUEUE).await;
    assert!(matches!(bad, Err(NodeError::Name(_))));
}
