//! Masters that start late, stop and start again.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use ros1::{
    Master, Node, NodeOptions, PublisherOptions, ServiceError,
    xmlrpc::{Value, call_ros},
};
use tokio::{net::TcpListener, time::timeout};

use crate::{
    delaying_proxy::DelayingProxy,
    local::{
        TIMEOUT, free_port, is_registered, socket_address, start_master, start_node, wait_until,
    },
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_register_again_after_a_restart_under_load_and_no_message_is_lost() {
    let first = start_master().await;
    let address = socket_address(&first);
    let talker = start_node("talker", &first).await;
    let listener = start_node("listener", &first).await;
    let publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let _service = talker
        .serve("/serve", &SET_BOOL, |_| Ok(vec![1, 0, 0, 0, 0]))
        .await
        .unwrap();
    let mut subscriber = listener.subscribe("/chat", &STRING, 4096).await.unwrap();
    wait_until("the subscriber to connect", async || {
        publisher.subscribers() == 1
    })
    .await;

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
    let mut online = talker.master_online();
    for _ in 0..2 {
        timeout(TIMEOUT, online.wait_for(|online| *online))
            .await
            .unwrap()
            .unwrap();
        first.shutdown().await;
        timeout(TIMEOUT, online.wait_for(|online| !online))
            .await
            .unwrap()
            .unwrap();
        let again = Master::start(address).await.unwrap();
        let back = Instant::now();
        wait_until("both registrations", async || {
            is_registered(&again, &talker).await && is_registered(&again, &listener).await
        })
        .await;
        // A node must register again within 2 s; the other 2 s are a margin for a busy machine.
        assert!(
            back.elapsed() < Duration::from_secs(4),
            "{:?}",
            back.elapsed()
        );
        println!("registered again after {:?}", back.elapsed());
        wait_until("the service to answer", async || {
            listener.call("/serve", &SET_BOOL, &[1]).await.is_ok()
        })
        .await;
        again.shutdown().await;
    }
    ended.store(true, Relaxed);
    let published = load.join().unwrap();
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!((publisher.subscribers(), publisher.dropped()), (1, 0));
    listener.shutdown().await;
    assert_eq!(received.await.unwrap(), (published, 0));
}

#[tokio::test]
async fn a_node_starts_without_a_master_and_registers_when_there_is_one() {
    let port = free_port();
    let uri = format!("http://127.0.0.1:{port}/");
    let talker = Node::start(NodeOptions::new("talker", &uri)).await.unwrap();
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let listener = Node::start(NodeOptions::new("listener", &uri))
        .await
        .unwrap();
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    assert!(!*talker.master_online().borrow());
    let error = listener.call("/serve", &SET_BOOL, &[]).await.unwrap_err();
    assert!(matches!(error, ServiceError::Lookup { .. }), "{error}");
    let master = Master::start(SocketAddr::from(([127, 0, 0, 1], port)))
        .await
        .unwrap();
    let message = timeout(TIMEOUT, subscriber.recv()).await.unwrap();
    assert_eq!(message, Some(string("hello")));
    timeout(TIMEOUT, talker.master_online().wait_for(|online| *online))
        .await
        .unwrap()
        .unwrap();
    drop(master);
}

#[tokio::test]
async fn a_publisher_missing_from_the_masters_list_keeps_its_open_connection() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let listener = start_node("listener", &master).await;
    let publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    wait_until("the subscriber to connect", async || {
        publisher.subscribers() == 1
    })
    .await;
    // A restarted master lists only publishers that have registered again, so this list is empty.
    let update = [Value::from("/master"), "/chat".into(), Value::Array(vec![])];
    call_ros(listener.uri(), "publisherUpdate", &update)
        .await
        .unwrap();
    publisher.publish(&string("still here"));
    let message = timeout(TIMEOUT, subscriber.recv()).await.unwrap();
    assert_eq!(message, Some(string("still here")));
    drop(publisher);
    wait_until("the connection to close", async || {
        subscriber.publishers() == 0
    })
    .await;
}

#[tokio::test]
async fn a_topic_dropped_and_subscribed_again_during_its_registration_finds_its_publishers() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let port = free_port();
    let uri = format!("http://127.0.0.1:{port}/");
    let listener = Node::start(NodeOptions::new("listener", &uri))
        .await
        .unwrap();
    // No master listens yet, so the registration task registers the topic later.
    let first = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    let socket = TcpListener::bind(("127.0.0.1", port)).await.unwrap();
    let proxy = DelayingProxy::start(socket, &master, "registerSubscriber");
    proxy.wait_until_held().await;
    drop(first);
    let again = async {
        let mut second = listener.subscribe("/chat", &STRING, 4).await.unwrap();
        timeout(TIMEOUT, second.recv()).await.unwrap()
    };
    let answer = async {
        tokio::time::sleep(Duration::from_millis(200)).await;
        proxy.release();
    };
    assert_eq!(tokio::join!(again, answer).0, Some(string("hello")));
}
