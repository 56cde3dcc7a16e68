//! Masters that refuse, and masters that take a call and say nothing.

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
    local::{free_port, knows, until},
    types::{SET_BOOL, STRING},
};

const QUEUE: PublisherOptions = PublisherOptions {
    queue: 4,
    latch: false,
};

/// Counts what is logged as an error.
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
async fn what_is_refused_again_and_again_is_logged_once() {
    let errors = Arc::new(AtomicUsize::new(0));
    let _log = tracing::subscriber::set_default(ErrorCount(Arc::clone(&errors)));
    let port = free_port();
    let uri = format!("http://127.0.0.1:{port}/");
    let ours = Node::start(NodeOptions::new("ours", &uri)).await.unwrap();
    // Nobody there: both are offered later.
    let _publisher = ours.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let _subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
    let listener = TcpListener::bind(("127.0.0.1", port)).await.unwrap();
    let refusal = Value::Array(vec![(-1).into(), "not you".into(), 0.into()]);
    let body = encode_response(&Ok(refusal));
    let mut registrations = 0;
    while registrations < 6 {
        let (mut stream, _) = listener.accept().await.unwrap();
        // The request is small and comes in one piece.
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
async fn a_master_that_says_nothing_holds_nobody_up_and_is_told_when_it_answers() {
    // It takes connections, by the system's queue, and never reads.
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
    // One wait of 2 s for all four; the rest is for a busy machine.
    let waited = started.elapsed();
    assert!(waited < Duration::from_secs(4), "{waited:?}");
    drop(silent);
    let master = Master::start(address).await.unwrap();
    until("the node", async || knows(&master, &talker).await).await;
    until("the service", async || {
        talker.call("/serve", &SET_BOOL, &[]).await.is_ok()
    })
    .await;
    talker.shutdown().await;
}
