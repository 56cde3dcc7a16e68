//! Masters that refuse registrations, and masters that accept a connection and never answer.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use ros1::{
    Master, Node, NodeOptions, PublisherOptions,
    xmlrpc::{Value, encode_response},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpListener,
    time::sleep,
};
use tracing::{Event, Level, Metadata, Subscriber, span};

use crate::{
    local::{free_port, is_registered, wait_until},
    types::{SET_BOOL, STRING},
};

const QUEUE: PublisherOptions = PublisherOptions {
    queue: 4,
    latch: false,
};

/// Counts log entries of level ERROR.
struct ErrorCount(Arc<AtomicUsize>);

impl Subscriber for ErrorCount {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() == Level::ERROR
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn event(&self, _: &Event<'_>) {
        self.0.fetch_add(1, Relaxed);
    }

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

#[tokio::test]
async fn a_registration_that_is_refused_repeatedly_is_logged_once() {
    let errors = Arc::new(AtomicUsize::new(0));
    let _log = tracing::subscriber::set_default(ErrorCount(Arc::clone(&errors)));
    let port = free_port();
    let uri = format!("http://127.0.0.1:{port}/");
    let ours = Node::start(NodeOptions::new("ours", &uri)).await.unwrap();
    // No master listens yet, so publisher and subscriber are registered later.
    let _publisher = ours.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let _subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
    let listener = TcpListener::bind(("127.0.0.1", port)).await.unwrap();
    let refusal = Value::Array(vec![(-1).into(), "not you".into(), 0.into()]);
    let body = encode_response(&Ok(refusal));
    let mut registrations = 0;
    while registrations < 6 {
        let (mut stream, _) = listener.accept().await.unwrap();
        // A request of at most 4096 bytes on loopback arrives in one read.
        let mut request = vec![0; 4096];
        let count = stream.read(&mut request).await.unwrap();
        let request = String::from_utf8_lossy(&request[..count]);
        registrations += usize::from(request.contains("<methodName>register"));
        let head = "HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n";
        stream
            .write_all(format!("{head}{body}").as_bytes())
            .await
            .unwrap();
    }
    sleep(Duration::from_millis(100)).await;
    assert_eq!(errors.load(Relaxed), 2);
}

#[tokio::test]
async fn a_silent_master_delays_advertising_only_once_and_gets_the_registrations_later() {
    // The operating system accepts connections to this listener, but no program reads from them.
    let silent = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let address = silent.local_addr().unwrap();
    let uri = format!("http://{address}/");
    let talker = Node::start(NodeOptions::new("talker", &uri)).await.unwrap();
    let started = Instant::now();
    let mut publishers = Vec::new();
    for topic in ["/a", "/b", "/c"] {
        publishers.push(talker.advertise(topic, &STRING, QUEUE).await.unwrap());
    }
    let _service = talker
        .serve("/serve", &SET_BOOL, |_| Ok(vec![7]))
        .await
        .unwrap();
    // The four calls together wait for one timeout of 2 s; the other 2 s are a margin for a busy
    // machine.
    let waited = started.elapsed();
    assert!(waited < Duration::from_secs(4), "{waited:?}");
    drop(silent);
    let master = Master::start(address).await.unwrap();
    wait_until("the registration", async || {
        is_registered(&master, &talker).await
    })
    .await;
    wait_until("the service to answer", async || {
        talker.call("/serve", &SET_BOOL, &[]).await.is_ok()
    })
    .await;
    talker.shutdown().await;
}
