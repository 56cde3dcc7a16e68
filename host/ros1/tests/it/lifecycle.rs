//! Tests of the start and shutdown of nodes and masters, and of two nodes with the same name.

use std::time::Duration;

use ros1::{
    DEFAULT_MASTER_URI, Master, Node, NodeError, NodeOptions,
    xmlrpc::{Value, call_ros},
};
use tokio::time::timeout;

use crate::local::{
    LATCH, QUEUE, SET_BOOL, STRING, TIMEOUT, Talker, answers, expect_text, is_registered,
    report_skipped, serve, socket_address, start_master, start_node, string, wait_for_subscribers,
    wait_until,
};

async fn system_state(master: &Master) -> Value {
    let state = call_ros(master.uri(), "getSystemState", &["/test".into()]).await;
    state.unwrap()
}

fn no_registrations() -> Value {
    Value::Array(vec![Value::Array(vec![]); 3])
}

#[tokio::test]
async fn a_second_node_takes_the_name_and_the_first_is_asked_to_shut_down() {
    let master = start_master().await;
    let old = start_node("same", &master).await;
    let old_topic = old.advertise("/chat", &STRING, LATCH).await.unwrap();
    old_topic.publish(&string("old"));
    let new = start_node("same", &master).await;
    let new_topic = new.advertise("/chat", &STRING, LATCH).await.unwrap();
    new_topic.publish(&string("new"));
    timeout(TIMEOUT, old.shutdown_requested()).await.unwrap();
    // Wait longer than the node's check period of 1 s: the displaced node must not register again.
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert!(is_registered(master.uri(), &new).await);
    old.shutdown().await;
    assert!(is_registered(master.uri(), &new).await);
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    expect_text(&mut subscriber, "new").await;
    assert_eq!(subscriber.publishers(), 1);
    let requested = timeout(Duration::from_millis(200), new.shutdown_requested()).await;
    assert!(requested.is_err());
}

#[tokio::test]
async fn shutdown_unregisters_everything_sends_queued_messages_and_frees_the_ports() {
    let talker = Talker::start(QUEUE).await;
    let (node, publisher) = (&talker.node, &talker.publisher);
    let _service = serve(node, "/serve", &[]).await;
    let (listener, mut subscriber) = talker.listener(4096).await;
    wait_for_subscribers(publisher, 1).await;
    for number in 0..1000 {
        publisher.publish(&string(&number.to_string()));
    }
    node.shutdown().await;
    node.shutdown().await;
    assert_eq!(publisher.publish(&string("late")), 0);
    let refused = node.advertise("/more", &STRING, QUEUE).await;
    assert!(matches!(refused, Err(NodeError::ShutDown)));
    for number in 0..1000 {
        expect_text(&mut subscriber, &number.to_string()).await;
    }
    assert!(!answers(node.uri()).await);
    listener.shutdown().await;
    assert_eq!(subscriber.recv().await, None);
    assert_eq!(system_state(&talker.master).await, no_registrations());
    let address = socket_address(&talker.master);
    talker.master.shutdown().await;
    drop(std::net::TcpListener::bind(address).unwrap());
}

#[tokio::test]
async fn dropped_handles_are_unregistered_and_their_names_are_free_again() {
    let master = start_master().await;
    let ours = start_node("ours", &master).await;
    for round in 0..3 {
        let publisher = ours.advertise("/chat", &STRING, LATCH).await.unwrap();
        let twice = ours.advertise("/chat", &STRING, LATCH).await;
        assert!(matches!(twice, Err(NodeError::Duplicate(_))));
        let mut subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
        let service = serve(&ours, "/serve", &[]).await;
        publisher.publish(&string(&format!("{round}")));
        expect_text(&mut subscriber, &format!("{round}")).await;
        drop((publisher, subscriber, service));
    }
    wait_until("the unregistration", async || system_state(&master).await == no_registrations())
        .await;
}

#[tokio::test]
async fn topics_and_services_work_over_ipv6() {
    let Ok(master) = Master::start("[::1]:0".parse().unwrap()).await else {
        report_skipped("topics and services over IPv6", "this machine has no IPv6");
        return;
    };
    let talker = start_node("talker", &master).await;
    let uri = talker.uri();
    assert!(uri.starts_with("http://[::1]:"), "{uri}");
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let _service = serve(&talker, "/serve", &[7]).await;
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    expect_text(&mut subscriber, "hello").await;
    assert_eq!(listener.call("/serve", &SET_BOOL, &[0]).await.unwrap(), [7]);
}

#[tokio::test]
async fn a_master_reports_a_shutdown_request_and_an_address_in_use() {
    let first = start_master().await;
    let second = Master::start(socket_address(&first)).await;
    assert_eq!(second.unwrap_err().kind(), std::io::ErrorKind::AddrInUse);
    let arguments = [Value::from("/test"), "enough".into()];
    call_ros(first.uri(), "shutdown", &arguments).await.unwrap();
    timeout(TIMEOUT, first.shutdown_requested()).await.unwrap();
    first.shutdown().await;
}

#[tokio::test]
async fn invalid_names_and_uris_are_refused_at_once() {
    let start = async |name: &str, uri: &str| Node::start(NodeOptions::new(name, uri)).await;
    let name = start("no name", DEFAULT_MASTER_URI).await;
    assert!(matches!(name, Err(NodeError::Name(_))));
    let uri = start("ours", "localhost:11311").await;
    assert!(matches!(uri, Err(NodeError::MasterUri(_))));
    let mut elsewhere = NodeOptions::new("ours", DEFAULT_MASTER_URI);
    elsewhere.remaps = vec![("bad name".to_owned(), "x".to_owned())];
    let remap = Node::start(elsewhere).await;
    assert!(matches!(remap, Err(NodeError::Name(_))));
    let master = start_master().await;
    let ours = start_node("ours", &master).await;
    let bad = ours.advertise("a b", &STRING, QUEUE).await;
    assert!(matches!(bad, Err(NodeError::Name(_))));
}
