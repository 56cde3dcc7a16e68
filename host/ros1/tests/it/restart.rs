//! Masters that start late, stop and start again, refuse registrations or never answer.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use ros1::{
    MasterStatus, ServiceError,
    xmlrpc::{Value, call_ros},
};
use tokio::{net::TcpListener, time::sleep};
use tracing::Level;

use crate::{
    fakes::{DelayingProxy, answer_one},
    local::{
        LATCH, QUEUE, SET_BOOL, STRING, Talker, expect_text, free_port, is_registered, master_at,
        node_at, serve, socket_address, string, uri, wait_for_master, wait_for_registration,
        wait_for_subscribers, wait_until,
    },
    log::Log,
};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_register_again_after_a_restart_under_load_and_no_message_is_lost() {
    let talker = Talker::start(QUEUE).await;
    let (first, node, publisher) = (&talker.master, &talker.node, &talker.publisher);
    let address = socket_address(first);
    let _service = serve(node, "/serve", &[1, 0, 0, 0, 0]).await;
    let (listener, mut subscriber) = talker.listener(4096).await;
    wait_for_subscribers(publisher, 1).await;

    let ended = Arc::new(AtomicBool::new(false));
    let load = std::thread::spawn({
        let (publisher, ended) = (publisher.clone(), Arc::clone(&ended));
        move || {
            let mut number = 0_u32;
            while !ended.load(Relaxed) {
                publisher.publish(&string(&number.to_string()));
                number += 1;
                std::thread::sleep(Duration::from_millis(1));
            }
            number
        }
    });
    let received = tokio::spawn(async move {
        let mut expected = 0_u32;
        while let Some(message) = subscriber.recv().await {
            assert_eq!(message, string(&expected.to_string()));
            expected += 1;
        }
        (expected, subscriber.dropped())
    });
    for _ in 0..2 {
        wait_for_master(node, true).await;
        first.shutdown().await;
        wait_for_master(node, false).await;
        let again = master_at(address).await;
        wait_for_registration(again.uri(), &[node, &listener]).await;
        wait_until("the service to answer", async || {
            listener.call("/serve", &SET_BOOL, &[1]).await.is_ok()
        })
        .await;
        again.shutdown().await;
    }
    ended.store(true, Relaxed);
    let published = load.join().unwrap();
    sleep(Duration::from_millis(300)).await;
    assert_eq!((publisher.subscribers(), publisher.dropped()), (1, 0));
    listener.shutdown().await;
    assert_eq!(received.await.unwrap(), (published, 0));
}

#[tokio::test]
async fn a_node_starts_without_a_master_and_registers_when_there_is_one() {
    let address = SocketAddr::from(([127, 0, 0, 1], free_port()));
    let uri = uri(address.port());
    let talker = node_at("talker", &uri).await;
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let listener = node_at("listener", &uri).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    assert_ne!(*talker.master_status().borrow(), MasterStatus::Online);
    let error = listener.call("/serve", &SET_BOOL, &[]).await.unwrap_err();
    assert!(matches!(error, ServiceError::Lookup(..)), "{error}");
    let _master = master_at(address).await;
    expect_text(&mut subscriber, "hello").await;
    wait_for_master(&talker, true).await;
}

#[tokio::test]
async fn a_publisher_missing_from_the_masters_list_keeps_its_open_connection() {
    let talker = Talker::start(QUEUE).await;
    let (listener, mut subscriber) = talker.listener(4).await;
    wait_for_subscribers(&talker.publisher, 1).await;
    // A restarted master lists only publishers that have registered again, so this list is empty.
    let update = [Value::from("/master"), "/chat".into(), Value::Array(vec![])];
    let updated = call_ros(listener.uri(), "publisherUpdate", &update).await;
    updated.unwrap();
    talker.publisher.publish(&string("still here"));
    expect_text(&mut subscriber, "still here").await;
    drop(talker.publisher);
    wait_until("the connection to close", async || subscriber.publishers() == 0).await;
}

#[tokio::test]
async fn a_topic_dropped_and_subscribed_again_during_its_registration_finds_its_publishers() {
    let talker = Talker::latched().await;
    let port = free_port();
    let listener = node_at("listener", &uri(port)).await;
    // No master listens yet, so the registration task registers the topic later.
    let first = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    let socket = TcpListener::bind(("127.0.0.1", port)).await.unwrap();
    let proxy = DelayingProxy::start(socket, &talker.master, "registerSubscriber");
    proxy.wait_until_held().await;
    drop(first);
    let again = async {
        let mut second = listener.subscribe("/chat", &STRING, 4).await.unwrap();
        expect_text(&mut second, "hello").await;
    };
    let answer = async {
        sleep(Duration::from_millis(200)).await;
        proxy.release();
    };
    tokio::join!(again, answer);
}

#[tokio::test]
async fn a_registration_that_is_refused_repeatedly_is_logged_once() {
    let log = Log::start();
    let port = free_port();
    let ours = node_at("ours", &uri(port)).await;
    // No master listens yet, so publisher and subscriber are registered later.
    let _publisher = ours.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let _subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
    let listener = TcpListener::bind(("127.0.0.1", port)).await.unwrap();
    let mut registrations = 0;
    while registrations < 6 {
        let refusal = [(-1).into(), "not you".into(), 0.into()];
        let request = answer_one(&listener, refusal).await;
        registrations += usize::from(request.contains("<methodName>register"));
    }
    sleep(Duration::from_millis(100)).await;
    assert_eq!(log.count(Level::ERROR, "the master refused"), 2);
}

#[tokio::test]
async fn a_silent_master_delays_advertising_only_once_and_gets_the_registrations_later() {
    // The operating system accepts connections to this listener, but no program reads from them.
    let silent = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let address = silent.local_addr().unwrap();
    let talker = node_at("talker", &uri(address.port())).await;
    let started = Instant::now();
    let mut publishers = Vec::new();
    for topic in ["/a", "/b", "/c"] {
        publishers.push(talker.advertise(topic, &STRING, QUEUE).await.unwrap());
    }
    let _service = serve(&talker, "/serve", &[7]).await;
    // The four calls together wait for one timeout of 2 s; the other 2 s are a margin for a busy
    // machine.
    let waited = started.elapsed();
    assert!(waited < Duration::from_secs(4), "{waited:?}");
    drop(silent);
    let master = master_at(address).await;
    wait_until("the registration", async || is_registered(master.uri(), &talker).await).await;
    wait_until("the service to answer", async || {
        talker.call("/serve", &SET_BOOL, &[]).await.is_ok()
    })
    .await;
    talker.shutdown().await;
}
